/** Sends files with progress; can be cancelled. */

import { problemFrom, ProblemError, unreachable, uploadUrl } from "../api/rest";
import type { Dataset } from "../generated/proto";
import { distinctNames } from "./grouping";

/** Window of the shown speed, milliseconds. */
const SPEED_WINDOW_MILLIS = 3000;

export interface Progress {
  sent: number;
  total: number;
  bytesPerSecond: number;
}

/** Speed over the last moments of a transfer. */
export class SpeedMeter {
  private marks: { at: number; sent: number }[] = [];

  /** `sent` bytes have gone at `now`; the speed in bytes per second. */
  mark(sent: number, now: number): number {
    this.marks = [...this.marks.filter((mark) => now - mark.at <= SPEED_WINDOW_MILLIS), { at: now, sent }];
    const first = this.marks[0];
    if (!first || now <= first.at) return 0;
    return ((sent - first.sent) / (now - first.at)) * 1000;
  }
}

export interface Upload {
  done: Promise<Dataset>;
  cancel: () => void;
}

/** Uploads files as one dataset. `done` fails with a `ProblemError`, or with an `AbortError` if cancelled. */
export function startUpload(files: readonly File[], onProgress: (progress: Progress) => void): Upload {
  const request = new XMLHttpRequest();
  const speed = new SpeedMeter();
  const done = new Promise<Dataset>((resolve, reject) => {
    request.upload.onprogress = ({ loaded, total }) =>
      onProgress({ sent: loaded, total, bytesPerSecond: speed.mark(loaded, performance.now()) });
    request.onload = () => {
      if (request.status < 200 || request.status >= 300) {
        reject(problemFrom(request.status, request.responseText));
        return;
      }
      try {
        resolve(JSON.parse(request.responseText) as Dataset);
      } catch {
        reject(new ProblemError({ type: "about:blank", title: "Unreadable answer", status: request.status, detail: "The service answered with something that is no dataset." }));
      }
    };
    request.onerror = () => reject(unreachable());
    request.onabort = () => reject(new DOMException("cancelled", "AbortError"));
  });
  const form = new FormData();
  const names = distinctNames(files.map((file) => file.name));
  files.forEach((file, index) => form.append("file", file, names[index]));
  request.open("POST", uploadUrl);
  request.send(form);
  return { done, cancel: () => request.abort() };
}
