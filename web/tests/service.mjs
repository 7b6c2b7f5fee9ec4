// A service of its own for a check or a picture.

import { spawn } from "node:child_process";

/** Starts the program's service on a free port with this data folder: its process, and its address once it listens. */
export function start(program, data, ...flags) {
  const child = spawn(program, ["serve", "--listen", "127.0.0.1:0", "--data-dir", data, ...flags]);
  const address = new Promise((found, fail) => {
    let log = "";
    const read = chunk => {
      log += chunk;
      const match = /http:\/\/127[0-9.:]+/.exec(log);
      if (match) found(match[0]);
    };
    child.stdout.on("data", read);
    child.stderr.on("data", read);
    child.on("exit", () => fail(new Error(log)));
  });
  return { child, address };
}
