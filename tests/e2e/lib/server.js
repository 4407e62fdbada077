/** The service as a real process, with a data directory of its own. */

import { spawn } from "node:child_process";
import { once } from "node:events";
import { createWriteStream } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { artifact } from "./artifacts.js";
import { until } from "./wait.js";

const PROGRAM = process.env.TYNDALL_BIN ?? fileURLToPath(new URL("../../../target/release/tyndall", import.meta.url));
/** Longest start, milliseconds: a software device compiles its first shaders. */
const START_MILLIS = 30_000;
/** Longest end after it was asked to end, milliseconds. */
const STOP_MILLIS = 10_000;

/** A TCP port nobody listens on. */
async function freePort() {
  const probe = createServer().listen(0, "127.0.0.1");
  await once(probe, "listening");
  const { port } = probe.address();
  probe.close();
  await once(probe, "close");
  return port;
}

export class Server {
  #process = null;

  /** @param {number} port @param {string} data Directory that keeps datasets. */
  constructor(port, data) {
    this.port = port;
    this.data = data;
    this.origin = `http://127.0.0.1:${port}`;
    this.log = createWriteStream(artifact("server.log"), { flags: "a" });
  }

  static async start() {
    const server = new Server(await freePort(), await mkdtemp(join(tmpdir(), "tyndall-browser-test-")));
    await server.start();
    return server;
  }

  /** Starts the process, at the same address and on the same data after a `kill`. */
  async start() {
    const child = spawn(PROGRAM, ["serve", "--listen", `127.0.0.1:${this.port}`, "--data", this.data], { stdio: ["ignore", "pipe", "pipe"] });
    this.#process = child;
    child.stdout.pipe(this.log, { end: false });
    child.stderr.pipe(this.log, { end: false });
    let failed = null;
    child.on("error", (error) => (failed = `${PROGRAM}: ${error.message}`));
    child.on("exit", (code, signal) => (failed ??= `the service ended at once (${code ?? signal}); see ${artifact("server.log")}`));
    await until("the service answers", START_MILLIS, async () => {
      if (failed) throw new Error(failed);
      return (await fetch(`${this.origin}/api/v1/status`).catch(() => null))?.ok;
    });
  }

  /** Ends the process without warning. */
  async kill(signal = "SIGKILL") {
    const child = this.#process;
    if (!child || child.exitCode !== null || child.signalCode !== null) return;
    const ended = once(child, "exit");
    child.kill(signal);
    const late = setTimeout(() => child.kill("SIGKILL"), STOP_MILLIS);
    await ended;
    clearTimeout(late);
  }

  /** Ends the process and removes its data. */
  async end() {
    await this.kill("SIGTERM");
    await rm(this.data, { recursive: true, force: true });
    this.log.end();
  }

  /** The JSON answer of the REST interface; fails on an answer that is no success. */
  async json(method, path, body) {
    const answer = await fetch(`${this.origin}/api/v1/${path}`, {
      method,
      ...(body === undefined ? {} : { body: JSON.stringify(body), headers: { "content-type": "application/json" } }),
    });
    if (!answer.ok) throw new Error(`${method} ${path}: ${answer.status} ${await answer.text()}`);
    return answer.json();
  }

  /** Stores one file as a dataset and returns its description. */
  async upload(name, bytes) {
    const answer = await fetch(`${this.origin}/api/v1/datasets/${name}`, { method: "PUT", body: bytes });
    if (!answer.ok) throw new Error(`PUT ${name}: ${answer.status} ${await answer.text()}`);
    return answer.json();
  }
}
