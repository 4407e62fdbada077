/**
 * The address bar: `#session=<id>` while working, `#scene=<...>` in a shared link.
 *
 * A shared scene is its JSON, deflated (raw, RFC 1951) and written in base64url.
 */

import type { SceneFile } from "../generated/proto";

/** Longest decoded scene a link may hold, bytes. */
const MAX_SCENE_BYTES = 4 << 20;

export type Address = { kind: "session"; id: string } | { kind: "scene"; code: string } | { kind: "none" };

/** What the fragment of the address asks for. */
export function parseAddress(hash: string): Address {
  const parameters = new URLSearchParams(hash.replace(/^#/, ""));
  const code = parameters.get("scene");
  if (code) return { kind: "scene", code };
  const id = parameters.get("session");
  return id ? { kind: "session", id } : { kind: "none" };
}

export const sessionAddress = (id: string): string => `#session=${encodeURIComponent(id)}`;

/** The scene as text for a link. */
export async function encodeScene(scene: SceneFile): Promise<string> {
  const text = new Blob([JSON.stringify(scene)]);
  const deflated = await readAll(text.stream().pipeThrough(new CompressionStream("deflate-raw")));
  return base64urlFromBytes(deflated);
}

/** The scene of a link; throws an error in words if it cannot be one. */
export async function decodeScene(code: string): Promise<SceneFile> {
  try {
    const deflated = new Blob([bytesFromBase64url(code)]);
    const inflated = await readAll(deflated.stream().pipeThrough(new DecompressionStream("deflate-raw")));
    return asScene(JSON.parse(new TextDecoder().decode(inflated)));
  } catch (cause) {
    throw new Error("This link does not hold a whole scene; it may have been cut off when it was copied.", { cause });
  }
}

/** Checks that a JSON value looks like a scene; the server checks the rest. */
export function asScene(value: unknown): SceneFile {
  if (!looksLikeScene(value)) throw new Error("This is not a scene file: `version` and `volume` are missing.");
  return value;
}

export function looksLikeScene(value: unknown): value is SceneFile {
  return typeof value === "object" && value !== null && "version" in value && "volume" in value;
}

async function readAll(stream: ReadableStream<Uint8Array>): Promise<Uint8Array> {
  const parts: Uint8Array[] = [];
  let bytes = 0;
  const reader = stream.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    bytes += value.byteLength;
    if (bytes > MAX_SCENE_BYTES) {
      await reader.cancel();
      throw new Error("too long");
    }
    parts.push(value);
  }
  const all = new Uint8Array(bytes);
  let offset = 0;
  for (const part of parts) {
    all.set(part, offset);
    offset += part.byteLength;
  }
  return all;
}

export function base64urlFromBytes(bytes: Uint8Array): string {
  const binary = Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
  return btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

export function bytesFromBase64url(text: string): Uint8Array<ArrayBuffer> {
  const binary = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i += 1) bytes[i] = binary.charCodeAt(i);
  return bytes;
}
