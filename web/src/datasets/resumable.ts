/** What resumable uploads need to know of files: how to find them again, and how several become one. */

import { distinctNames } from "./grouping";

/** What tells a file from another without reading it. */
export interface KnownFile {
  name: string;
  size: number;
  lastModified: number;
}

/** In the order in which they are sent, however they were dropped. */
export const inOrder = <F extends KnownFile>(files: readonly F[]): F[] =>
  [...files].sort((a, b) => (a.name < b.name ? -1 : a.name > b.name ? 1 : a.size - b.size || a.lastModified - b.lastModified));

/** FNV-1a of a text's UTF-16 units, 32 bits. */
function fnv(text: string, seed: number): number {
  let hash = seed;
  for (let at = 0; at < text.length; at += 1) hash = Math.imul(hash ^ text.charCodeAt(at), 0x01000193);
  return hash >>> 0;
}

/** The same for the same files after a reload; says nothing of their content. */
export function fingerprint(files: readonly KnownFile[]): string {
  const text = inOrder(files).map(({ name, size, lastModified }) => `${name}\n${size}\n${lastModified}`).join("\n\n");
  const digits = [0x811c9dc5, 0x2f7a3b91].map((seed) => fnv(text, seed).toString(16).padStart(8, "0"));
  return `tyndall-${digits.join("")}-${files.reduce((sum, file) => sum + file.size, 0)}`;
}

const FORM = "multipart/form-data; boundary=";

export const formType = (boundary: string): string => FORM + boundary;

/** The boundary of a form's media type, null for anything else. */
export const boundaryOf = (type: string | undefined): string | null => (type?.startsWith(FORM) ? type.slice(FORM.length) : null);

export function randomBoundary(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Several files as the body of a form. Nothing is read before it is sent. */
export function formOf(files: readonly File[], boundary: string): Blob {
  const ordered = inOrder(files);
  const names = distinctNames(ordered.map((file) => file.name));
  // As browsers write names into forms.
  const escaped = (name: string) => name.replace(/\n/g, "%0A").replace(/\r/g, "%0D").replace(/"/g, "%22");
  const parts = ordered.flatMap((file, index) => {
    const head = `--${boundary}\r\nContent-Disposition: form-data; name="file"; filename="${escaped(names[index] ?? file.name)}"\r\n\r\n`;
    return [head, file, "\r\n"];
  });
  return new Blob([...parts, `--${boundary}--\r\n`]);
}

/** Whether a request that was answered with this status (0: not at all) may succeed by itself a little later. */
export const mayPass = (status: number): boolean => [0, 408, 409, 423, 502, 503, 504].includes(status);

/** Seconds that are left, in words; empty where nobody can know. */
export function timeLeft(missing: number, bytesPerSecond: number): string {
  if (!(bytesPerSecond > 0)) return "";
  const seconds = Math.ceil(missing / bytesPerSecond);
  if (seconds < 60) return `${seconds} s left`;
  if (seconds < 3600) return `${Math.ceil(seconds / 60)} min left`;
  return `${Math.ceil(seconds / 3600)} h left`;
}
