/** Files that leave the page: stills, scenes, links. */

import { session } from "../session/engine";
import { encodeScene } from "../session/shareLink";
import { useSession } from "../session/store";
import { say, sayError } from "./say";
import { stillName } from "./stillName";

export function download(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  // The browser has taken the blob once the click is handled; a moment later it can go.
  window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

export const baseName = (): string => (useSession.getState().dataset?.name ?? "scene").replace(/[^\w.-]+/g, "_");

export async function saveStill(): Promise<void> {
  say("Drawing a still on the server …");
  const name = stillName(baseName(), useSession.getState().scene?.rendering.mode ?? "volume", new Date());
  try {
    download(await session.still(), name);
  } catch (error) {
    sayError(error);
  }
}

export function saveScene(): void {
  const { scene } = useSession.getState();
  if (scene) download(new Blob([`${JSON.stringify(scene, null, 2)}\n`], { type: "application/json" }), `${baseName()}.scene.json`);
}

export async function copyShareLink(): Promise<void> {
  const { scene } = useSession.getState();
  if (!scene) return;
  const { origin, pathname } = window.location;
  const link = `${origin}${pathname}#scene=${await encodeScene(scene)}`;
  try {
    await navigator.clipboard.writeText(link);
    say("Link copied. It opens this scene with its view, lights and transfer function.");
  } catch {
    // No clipboard without HTTPS or permission: the person copies it by hand.
    window.prompt("Copy this link:", link);
  }
}
