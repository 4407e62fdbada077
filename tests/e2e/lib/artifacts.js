/** What a run leaves behind to be looked at: screenshots and the service's log. */

import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const FOLDER = fileURLToPath(new URL("../artifacts/", import.meta.url));

/** Path of a file in the folder that version control ignores. */
export function artifact(name) {
  mkdirSync(FOLDER, { recursive: true });
  return join(FOLDER, name);
}
