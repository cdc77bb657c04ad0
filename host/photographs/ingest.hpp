// SPDX-License-Identifier: MIT
// Ingest: a folder of photographs, one a lamp, and the .lp file that says where each lamp stood, as an archive.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "archive/archive.hpp"
#include "photographs/picture.hpp"

namespace ols {

struct IngestOptions {
    std::string directory;    // of the pictures
    std::string lights;       // .lp file that names them
    std::string output;       // archive to make
    std::string mask;         // picture that says where the subject is (subject_mask.hpp); empty: none
    std::string intensities;  // text file with how bright each light was (light_intensities.hpp); empty: none
    PictureOptions picture;   // how the pictures are read
    SampleType sample_type = SampleType::half_float;
    Compression compression = Compression::none;
    std::string production, scene, take, notes;  // slate
    bool overwrite = false;
    std::function<void(int done, int total)> progress = [](int, int) {};  // pictures read; one call at a time
};

struct IngestReport {
    int lamps = 0, width = 0, height = 0;
    Cfa cfa = Cfa::none;
    std::vector<std::string> said;    // what was converted, assumed or left out, and warnings
    std::vector<std::string> unused;  // pictures in the folder that the .lp file does not name
};

// Finds each light's picture by its name in the folder (picture_names.hpp), reads it to linear light (picture.hpp) and divides it by
// its light's intensity, if that is said. Lamp i of the archive is light i of the .lp file; its name is kept in the manifest.
//
// Pictures are decoded to an unnamed file beside the output, then tiled from there: memory holds one picture a thread
// and one block of tiles, the disk once the linear pictures (4 bytes a sample) and the archive. On any error (a missing,
// unreadable or ambiguous picture, sizes, orientations or mosaics that differ, too little disk) the output does not exist; an archive to be
// overwritten is removed only after every picture was read.
Result<IngestReport> ingest(const IngestOptions& options);

}  // namespace ols
