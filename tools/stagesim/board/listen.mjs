// SPDX-License-Identifier: MIT
// Listening at a socket's path.
import { existsSync, lstatSync, unlinkSync } from 'node:fs';

/** @returns {Promise<void>} listening; an old socket file of that name is replaced, any other file is not */
export function listenAt(path, server) {
  if (existsSync(path)) {
    if (!lstatSync(path).isSocket()) {
      return Promise.reject(new Error(`${path}: exists and is not a socket; remove it or name another`));
    }
    unlinkSync(path);
  }
  return new Promise((resolve, reject) => {
    server.once('error', (error) => reject(new Error(`${path}: cannot listen (${error.code})`)));
    server.listen(path, resolve);
  });
}
