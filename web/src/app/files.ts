/** Files that leave the page: stills, scenes, links. */

import { getSession } from "../api/rest";
import { session } from "../session/engine";
import { encodeScene, sessionAddress } from "../session/shareLink";
import { isWatching, useSession } from "../session/store";
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
  if (!isWatching(useSession.getState())) say("Drawing a still on the server …");
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

/** Puts a link to this page with another fragment on the clipboard. */
async function copyLink(fragment: string, opens: string): Promise<void> {
  const { origin, pathname } = window.location;
  const link = `${origin}${pathname}${fragment}`;
  try {
    await navigator.clipboard.writeText(link);
    say(`Link copied. ${opens}`);
  } catch {
    // No clipboard without HTTPS or permission: the person copies it by hand.
    window.prompt("Copy this link:", link);
  }
}

/** A link that holds the scene itself. */
export async function copySceneLink(): Promise<void> {
  const { scene } = useSession.getState();
  if (scene) await copyLink(`#scene=${await encodeScene(scene)}`, "It opens this scene with its view, lights and transfer function.");
}

/** A link to the session on screen: whoever opens it edits, too. */
export async function copySessionLink(): Promise<void> {
  const { sessionId } = useSession.getState();
  if (sessionId) await copyLink(sessionAddress(sessionId), "Whoever opens it edits this session with you.");
}

/** A link under which a session is looked at and not edited; by default that on screen. */
export async function copyWatchLink(watch?: string): Promise<void> {
  const { sessionId } = useSession.getState();
  // Those who watch are given no other identifier than the one they have.
  const id = watch ?? (sessionId && ((await getSession(sessionId)).watch ?? sessionId));
  if (id) await copyLink(sessionAddress(id), "Whoever opens it sees every edit and has a view of their own.");
}
