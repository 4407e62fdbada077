/** Sends files by tus: with progress, pauses, and going on after breaks and reloads. */

import { defaultOptions, DetailedError, Upload as TusUpload, type PreviousUpload } from "tus-js-client";
import { deleteUpload, getUpload, problemFrom, ProblemError, readUploadAgain, unreachable, uploadsUrl } from "../api/rest";
import type { Dataset, Upload } from "../generated/proto";
import { wordsOf } from "../session/words";
import { boundaryOf, fingerprint, formOf, formType, mayPass, randomBoundary } from "./resumable";

/** Window of the shown speed, milliseconds. */
const SPEED_WINDOW_MILLIS = 3000;
/** Bytes of one request: small enough for proxies that gather whole requests. */
const CHUNK_BYTES = 32 * 1024 * 1024;
/** Uploads up to this size are one request, which also begins them; a break costs them nothing worth keeping. */
const SMALL_BYTES = 1024 * 1024;
/** Pauses before trying again after a break, milliseconds: at once, soon, then for about an hour. */
const RETRY_MILLIS = [0, 500, 1000, 3000, ...Array<number>(720).fill(5000)];
/** How often the service is asked what became of an upload, milliseconds. */
const POLL_MILLIS = 400;

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

export type TransferState =
  /** `waiting`: the connection broke, and it is tried again. */
  | { kind: "sending"; progress: Progress; waiting: boolean }
  | { kind: "paused"; progress: Progress }
  /** Everything is sent; the service reads it. */
  | { kind: "checking" }
  | { kind: "done"; dataset: Dataset }
  /** `kept`: what was sent is still at the service, and it can go on from there. */
  | { kind: "failed"; message: string; kept: boolean };

/** Uploads that this browser began and has not heard the end of. */
const storage = defaultOptions.urlStorage;

/** One upload of one or more files as one dataset. */
export class Transfer {
  private tus: TusUpload | null = null;
  private progress: Progress;
  private speed = new SpeedMeter();
  private cancelled = false;
  /** Of its files. */
  readonly fingerprint: string;

  /** Nothing is sent before `start`. `name` is for people. */
  constructor(private readonly name: string, private readonly files: readonly File[], private readonly show: (state: TransferState) => void) {
    this.fingerprint = fingerprint(files);
    this.progress = { sent: 0, total: files.reduce((sum, file) => sum + file.size, 0), bytesPerSecond: 0 };
  }

  /** The upload's address at the service, once it has one. */
  get url(): string | null {
    return this.tus?.url ?? null;
  }

  /** Begins, or goes on where an earlier upload of the same files ended; `sent` is what is known of that one. */
  async start(sent = 0): Promise<void> {
    this.progress = { ...this.progress, sent };
    this.showSending(false);
    const [previous] = await storage.findUploadsByFingerprint(this.fingerprint);
    if (this.cancelled) return;
    const [only, second] = this.files;
    const boundary = second === undefined ? null : boundaryOf(previous?.metadata.filetype) ?? randomBoundary();
    const body = only !== undefined && boundary === null ? only : formOf(this.files, boundary ?? "");
    this.progress = { ...this.progress, total: body.size };
    this.tus = new TusUpload(body, {
      endpoint: uploadsUrl,
      metadata: { filename: this.name, ...(boundary === null ? {} : { filetype: formType(boundary) }) },
      fingerprint: () => Promise.resolve(this.fingerprint),
      chunkSize: CHUNK_BYTES,
      uploadDataDuringCreation: body.size <= SMALL_BYTES,
      retryDelays: RETRY_MILLIS,
      onShouldRetry: (error) => {
        const again = mayPass(statusOf(error));
        if (again) this.showSending(true);
        return again;
      },
      onProgress: (sent, total) => {
        this.progress = { sent, total, bytesPerSecond: this.speed.mark(sent, performance.now()) };
        this.showSending(false);
      },
      onSuccess: () => void this.hear(),
      onError: (error) => this.fail(problemOf(error)),
    });
    if (previous) this.tus.resumeFromPreviousUpload(previous);
    this.tus.start();
  }

  pause(): void {
    void this.tus?.abort();
    this.show({ kind: "paused", progress: { ...this.progress, bytesPerSecond: 0 } });
  }

  /** After a pause, or after a failure that left everything at the service. */
  goOn(): void {
    this.speed = new SpeedMeter();
    this.showSending(false);
    // At the end of a complete upload this sends nothing, and the service reads it again.
    this.tus?.start();
  }

  /** Ends the upload and removes what the service has of it. */
  async cancel(): Promise<void> {
    this.cancelled = true;
    // An upload that cannot be removed now expires.
    await this.tus?.abort(true).catch(() => undefined);
    await this.forget();
  }

  private showSending(waiting: boolean): void {
    if (!this.cancelled) this.show({ kind: "sending", progress: waiting ? { ...this.progress, bytesPerSecond: 0 } : this.progress, waiting });
  }

  private fail(problem: ProblemError): void {
    const kept = this.url !== null && problem.status !== 404 && problem.status !== 410;
    if (!this.cancelled) this.show({ kind: "failed", message: problem.message, kept });
  }

  private async hear(): Promise<void> {
    if (this.url === null || this.cancelled) return;
    this.show({ kind: "checking" });
    const state = await outcomeOf(this.url);
    if (state.kind !== "failed" || !state.kept) await this.forget();
    this.show(state);
  }

  private async forget(): Promise<void> {
    await forgetAll(await storage.findUploadsByFingerprint(this.fingerprint));
  }
}

async function forgetAll(uploads: readonly PreviousUpload[]): Promise<void> {
  for (const upload of uploads) await storage.removeUpload(upload.urlStorageKey);
}

const statusOf = (error: unknown): number => (error instanceof DetailedError ? error.originalResponse?.getStatus() ?? 0 : 0);

/** What the service said, or that it said nothing. */
function problemOf(error: unknown): ProblemError {
  const status = statusOf(error);
  if (status === 0 && error instanceof DetailedError) return unreachable();
  if (error instanceof DetailedError) return problemFrom(status, error.originalResponse?.getBody() ?? "");
  return new ProblemError({ type: "about:blank", title: "Not sent", status, detail: `The file cannot be sent: ${wordsOf(error)}` });
}

/** The state of a tile whose upload the service has heard the end of; null while it reads it, or bytes are missing. */
export function endOf(upload: Upload): TransferState | null {
  switch (upload.state) {
    case "stored":
      return upload.dataset
        ? { kind: "done", dataset: upload.dataset }
        : { kind: "failed", message: "The dataset was stored, and deleted since.", kept: false };
    case "refused":
      return { kind: "failed", message: upload.problem?.detail ?? "The service refused the file.", kept: false };
    case "failed":
      return { kind: "failed", message: upload.problem?.detail ?? "The service could not read the file.", kept: true };
    case "reading":
    case "receiving":
      return null;
  }
}

/** Waits for what becomes of a complete upload; a service that failed to read it is asked to try again once. */
export async function outcomeOf(url: string): Promise<TransferState> {
  for (let asked = 0; ; asked += 1) {
    try {
      const upload = await getUpload(url);
      if (upload.state === "failed" && asked === 0) await readUploadAgain(url, upload.length);
      else {
        const end = endOf(upload);
        if (end) return end;
      }
    } catch (error) {
      const problem = error instanceof ProblemError ? error : unreachable();
      if (!mayPass(problem.status)) return { kind: "failed", message: problem.message, kept: false };
    }
    await new Promise((done) => setTimeout(done, POLL_MILLIS));
  }
}

/** An upload that this browser began before the page was loaded. */
export interface Leftover {
  url: string;
  /** Of its files. */
  fingerprint: string;
  name: string;
  upload: Upload;
  /** No tile is needed for it again. */
  forget: () => Promise<void>;
}

/** Uploads that began before the page was loaded and have not ended; those that the service does not know any more are forgotten. */
export async function findLeftovers(): Promise<Leftover[]> {
  const found: Leftover[] = [];
  for (const previous of await storage.findAllUploads()) {
    const url = previous.uploadUrl;
    if (!url?.includes(uploadsUrl)) continue;
    const forget = () => forgetAll([previous]);
    try {
      // The storage's keys are `tus::FINGERPRINT::NUMBER`.
      found.push({ url, fingerprint: previous.urlStorageKey.split("::")[1] ?? "", name: previous.metadata.filename ?? "Upload", upload: await getUpload(url), forget });
    } catch (error) {
      if (error instanceof ProblemError && (error.status === 404 || error.status === 410)) await forget();
    }
  }
  return found;
}

/** Removes what the service has of an upload. */
export async function discard({ url, forget }: Pick<Leftover, "url" | "forget">): Promise<void> {
  await deleteUpload(url);
  await forget();
}
