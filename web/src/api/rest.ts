/** The REST side of the service. Every failure is a `ProblemError` that says in words what happened. */

import type { CreateSession, Dataset, Environment, Export, ExportRequest, Histogram, PreviewRequest, Probe, ProbeRequest, Problem, RegionHistogram, Session, Status, Upload } from "../generated/proto";

const BASE = "/api/v1";

/** A refused or failed request. `message` is for people. */
export class ProblemError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail || problem.title);
    this.name = "ProblemError";
  }

  get status(): number {
    return this.problem.status;
  }
}

/** Status of a request that never reached the service. */
export const UNREACHABLE = 0;

export const unreachable = (): ProblemError =>
  new ProblemError({
    type: "about:blank",
    title: "Not reachable",
    status: UNREACHABLE,
    detail: "The service cannot be reached. Check that it is running and that the network is up.",
  });

/** The problem a response body describes; made from the status where there is none. */
export function problemFrom(status: number, body: string): ProblemError {
  try {
    const problem = JSON.parse(body) as Partial<Problem>;
    if (typeof problem.title === "string" || typeof problem.detail === "string") {
      const { type = "about:blank", title = "", detail = "", field } = problem;
      return new ProblemError({ type, title, status, detail, ...(field === undefined ? {} : { field }) });
    }
  } catch {
    // Not a problem document: a proxy answered, or the body was cut off. The status says enough.
  }
  return new ProblemError({ type: "about:blank", title: `HTTP ${status}`, status, detail: `The service answered with status ${status}.` });
}

const send = (path: string, init: RequestInit): Promise<Response> => sendTo(BASE + path, init);

async function sendTo(url: string, init: RequestInit): Promise<Response> {
  const response = await fetch(url, init).catch(() => {
    throw unreachable();
  });
  if (!response.ok) throw problemFrom(response.status, await response.text());
  return response;
}

const getJson = async <T>(path: string): Promise<T> => (await (await send(path, {})).json()) as T;

const segment = encodeURIComponent;

export const getStatus = (): Promise<Status> => getJson("/status");
export const getDatasets = (): Promise<Dataset[]> => getJson("/datasets");
export const getDataset = (id: string): Promise<Dataset> => getJson(`/datasets/${segment(id)}`);
export const getHistogram = (id: string): Promise<Histogram> => getJson(`/datasets/${segment(id)}/histogram`);
export const thumbnailUrl = (id: string): string => `${BASE}/datasets/${segment(id)}/thumbnail`;
export const uploadsUrl = `${BASE}/uploads`;
export const getSession = (id: string): Promise<Session> => getJson(`/sessions/${segment(id)}`);

export const getSessions = (): Promise<Session[]> => getJson("/sessions");

export const getEnvironments = (): Promise<Environment[]> => getJson("/environments");
/** Address of a small picture, twice as wide as high. */
export const environmentPreviewUrl = (id: string): string => `${BASE}/environments/${segment(id)}/preview`;

/** Stores a picture of light. */
export async function putEnvironment(name: string, file: Blob): Promise<Environment> {
  return (await (await send(`/environments/${segment(name)}`, { method: "PUT", body: file })).json()) as Environment;
}

export async function deleteEnvironment(id: string): Promise<void> {
  await send(`/environments/${segment(id)}`, { method: "DELETE" });
}

/** Ends a session for everybody in it. */
export async function deleteSession(id: string): Promise<void> {
  await send(`/sessions/${segment(id)}`, { method: "DELETE" });
}

export async function deleteDataset(id: string): Promise<void> {
  await send(`/datasets/${segment(id)}`, { method: "DELETE" });
}

/** What became of a resumable upload; `url` is the address it was given. */
export const getUpload = async (url: string): Promise<Upload> => (await (await sendTo(url, {})).json()) as Upload;

const TUS = { "Tus-Resumable": "1.0.0" };

/** Has a complete upload read again. */
export async function readUploadAgain(url: string, length: number): Promise<void> {
  await sendTo(url, { method: "PATCH", headers: { ...TUS, "Upload-Offset": String(length), "Content-Type": "application/offset+octet-stream" } });
}

/** Cancels an upload; one that is gone is none. */
export async function deleteUpload(url: string): Promise<void> {
  await sendTo(url, { method: "DELETE", headers: TUS }).catch((error: unknown) => {
    if (!(error instanceof ProblemError) || ![404, 410].includes(error.status)) throw error;
  });
}

const postJson = (path: string, body: unknown, signal?: AbortSignal): Promise<Response> =>
  send(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    ...(signal ? { signal } : {}),
  });

export async function createSession(request: CreateSession): Promise<Session> {
  return (await (await postJson("/sessions", request)).json()) as Session;
}

/** The place under a pixel, and the value there. */
export async function postProbe(id: string, request: ProbeRequest): Promise<Probe> {
  return (await (await postJson(`/sessions/${segment(id)}/probe`, request)).json()) as Probe;
}

/** How often each value occurs in what the session's clip region keeps. */
export async function getRegionHistogram(id: string, signal: AbortSignal): Promise<RegionHistogram> {
  return (await (await send(`/sessions/${segment(id)}/histogram`, { signal })).json()) as RegionHistogram;
}

/** The session's scene with a patch, drawn small, as PNG. */
export async function postPreview(id: string, request: PreviewRequest, signal: AbortSignal): Promise<Blob> {
  return (await postJson(`/sessions/${segment(id)}/preview`, request, signal)).blob();
}

/** The session's scene drawn at full quality as PNG. */
export async function getSnapshot(id: string, width: number, height: number): Promise<Blob> {
  const response = await send(`/sessions/${segment(id)}/snapshot?format=png&width=${width}&height=${height}`, {});
  return response.blob();
}

/** Begins to draw a turntable or a film of the session's scene. */
export async function postExport(id: string, request: ExportRequest): Promise<Export> {
  return (await (await postJson(`/sessions/${segment(id)}/exports`, request)).json()) as Export;
}

export const getExport = (id: string): Promise<Export> => getJson(`/exports/${segment(id)}`);
export const exportFileUrl = (id: string): string => `${BASE}/exports/${segment(id)}/file`;

/** Stops an export; one that is gone needs no stopping. */
export async function deleteExport(id: string): Promise<void> {
  await send(`/exports/${segment(id)}`, { method: "DELETE" }).catch((error: unknown) => {
    if (!(error instanceof ProblemError) || error.status !== 404) throw error;
  });
}

/** Where a viewer of a session connects. */
export function viewUrl(id: string): string {
  const { protocol, host } = window.location;
  return `${protocol === "https:" ? "wss" : "ws"}://${host}${BASE}/sessions/${segment(id)}/view`;
}
