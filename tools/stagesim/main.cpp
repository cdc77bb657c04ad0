// SPDX-License-Identifier: MIT
// stagesim: the virtual stage.
#include "cli.hpp"

int main(int argc, char** argv) {
    return ols::stagesim_main(argc, argv);
}
