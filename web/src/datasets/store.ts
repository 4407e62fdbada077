/** The datasets the service offers, and the uploads of this page. */

import { create } from "zustand";
import { deleteDataset, getDatasets } from "../api/rest";
import { offer, say } from "../app/say";
import { useUi } from "../app/uiStore";
import type { Dataset, SceneFile } from "../generated/proto";
import { takeEnvironment } from "../lights/environmentStore";
import { session } from "../session/engine";
import { looksLikeScene } from "../session/shareLink";
import { useSession } from "../session/store";
import { wordsOf } from "../session/words";
import { openCurve } from "../transfer-function/curve";
import { formatBytes } from "./format";
import { groupFiles, sidecarName, type Group, type RawLayout } from "./grouping";
import { fingerprint } from "./resumable";
import { stacksApart } from "./stacks";
import { discard, endOf, findLeftovers, outcomeOf, Transfer, type Leftover, type TransferState } from "./upload";

/** Largest JSON file that is looked into to see whether it is a scene. */
const MAX_SCENE_BYTES = 4_000_000;

export interface UploadTile {
  id: number;
  name: string;
  /** Its files; none after a reload, when the page cannot reach them any more. */
  group: Group<File>;
  /** Sends them; absent before they are sent. */
  transfer?: Transfer;
  /** What was left at the service when the page was loaded. */
  leftover?: Leftover;
  state:
    /** The layout of a raw file is asked for. */
    | { kind: "layout" }
    /** A part of it is at the service; the rest needs the files again. */
    | { kind: "left"; sent: number; total: number }
    | TransferState;
}

interface DatasetsState {
  list: Dataset[];
  /** Why the list is not there. */
  listError: string | null;
  uploads: UploadTile[];
  /** Dataset being opened. */
  opening: string | null;
  /** Why something about one dataset did not work. */
  datasetError: { id: string; message: string } | null;
}

export const useDatasets = create<DatasetsState>(() => ({ list: [], listError: null, uploads: [], opening: null, datasetError: null }));

const set = useDatasets.setState;
let lastUpload = 0;

export async function refreshDatasets(): Promise<void> {
  try {
    set({ list: await getDatasets(), listError: null });
  } catch (error) {
    set({ listError: wordsOf(error) });
  }
}

/** Opens a dataset; why it did not work is shown at its card, and returned. */
export async function explore(id: string): Promise<string | null> {
  set({ opening: id, datasetError: null });
  const before = useSession.getState();
  try {
    await session.openDataset(id);
    // Another dataset starts a scene of its own; the edited one is kept where the browser's Back leads.
    if (before.canUndo && before.dataset && useSession.getState().sessionId !== before.sessionId) {
      offer(`Your scene of ${before.dataset.name} is one step back.`, "Go back", () => window.history.back());
    }
    // On a narrow page the list lies over the picture that was asked for.
    useUi.setState({ sheet: null });
    return null;
  } catch (error) {
    const message = wordsOf(error);
    set({ datasetError: { id, message } });
    return message;
  } finally {
    set({ opening: null });
  }
}

export async function removeDataset(id: string): Promise<void> {
  try {
    await deleteDataset(id);
    set(({ list, uploads }) => ({
      list: list.filter((dataset) => dataset.id !== id),
      uploads: uploads.filter(({ state }) => state.kind !== "done" || state.dataset.id !== id),
      datasetError: null,
    }));
  } catch (error) {
    set({ datasetError: { id, message: wordsOf(error) } });
  }
}

/** Takes dropped or chosen files: a scene is opened, everything else uploaded. */
export async function takeFiles(files: readonly File[]): Promise<void> {
  const volumes: File[] = [];
  for (const file of files) {
    if (/\.(hdr|exr)$/i.test(file.name)) {
      const taken = await takeEnvironment(file);
      if (taken) say(`${taken.name} is among the environments: select an environment light to use it.`);
      continue;
    }
    if (/\.tf\.json$/i.test(file.name)) {
      await openCurve(file);
      continue;
    }
    const scene = await sceneIn(file);
    if (scene) await session.openScene(scene);
    else volumes.push(file);
  }
  for (const group of (await Promise.all(groupFiles(volumes).map(stacksApart))).flat()) {
    const id = (lastUpload += 1);
    const tile: UploadTile = { id, name: group.name, group, state: { kind: "layout" } };
    set(({ uploads }) => ({ uploads: [tile, ...uploads] }));
    if (!group.needsLayout) void send(id, group.name, group.files);
  }
}

/** Uploads a raw file with a sidecar that states its layout. */
export function sendWithLayout(tile: UploadTile, layout: RawLayout): void {
  // Without a date of its own: the same file and layout are the same upload after a reload.
  const sidecar = new File([JSON.stringify(layout)], sidecarName(tile.name), { type: "application/json", lastModified: 0 });
  void send(tile.id, tile.name, [...tile.group.files, sidecar]);
}

/** After a failure: goes on where it can, begins anew where it must. */
export function retryUpload(tile: UploadTile): void {
  if (tile.state.kind === "failed" && tile.state.kept && tile.transfer) tile.transfer.goOn();
  else if (tile.leftover) void hearOf(tile.id, tile.leftover, true);
  else if (tile.group.needsLayout) update(tile.id, { state: { kind: "layout" } });
  else void send(tile.id, tile.name, tile.group.files);
}

export const dismissUpload = (id: number): void => set(({ uploads }) => ({ uploads: uploads.filter((tile) => tile.id !== id) }));

/** Ends an upload and removes what the service has of it. */
export async function cancelUpload(tile: UploadTile): Promise<void> {
  try {
    if (tile.transfer) await tile.transfer.cancel();
    else if (tile.leftover) await discard(tile.leftover);
    dismissUpload(tile.id);
  } catch (error) {
    update(tile.id, { state: { kind: "failed", message: wordsOf(error), kept: true } });
  }
}

/** Shows the uploads that a reload interrupted. */
export async function showLeftovers(): Promise<void> {
  for (const leftover of await findLeftovers()) {
    const known = useDatasets.getState().uploads.some((tile) => [tile.leftover?.fingerprint, tile.transfer?.fingerprint].includes(leftover.fingerprint));
    if (known) continue;
    const id = (lastUpload += 1);
    const { name, upload: { state, offset, length } } = leftover;
    const group: Group<File> = { name, files: [], needsLayout: false, slices: false };
    const shown: UploadTile["state"] = state === "receiving" ? { kind: "left", sent: offset, total: length } : { kind: "checking" };
    set(({ uploads }) => ({ uploads: [{ id, name, group, leftover, state: shown }, ...uploads] }));
    if (state !== "receiving") void hearOf(id, leftover);
  }
}

/** Waits for what becomes of an upload whose bytes are all at the service. */
async function hearOf(id: number, leftover: Leftover, again = false): Promise<void> {
  update(id, { state: { kind: "checking" } });
  const state = (again ? null : endOf(leftover.upload)) ?? (await outcomeOf(leftover.url));
  if (state.kind !== "failed" || !state.kept) await leftover.forget();
  update(id, { state });
  if (state.kind === "done") await refreshDatasets();
}

async function send(id: number, name: string, files: readonly File[]): Promise<void> {
  const total = files.reduce((sum, file) => sum + file.size, 0);
  const most = useSession.getState().status?.max_upload_bytes;
  if (most !== undefined && total > most) {
    update(id, { state: { kind: "failed", message: `The upload has ${formatBytes(total)}; this service takes at most ${formatBytes(most)}.`, kept: false } });
    return;
  }
  const same = useDatasets.getState().uploads.find((tile) => tile.id !== id && tile.transfer?.fingerprint === fingerprint(files) && ["sending", "paused"].includes(tile.state.kind));
  if (same) {
    // Dropped a second time: it is under way already.
    dismissUpload(id);
    if (same.state.kind === "paused") same.transfer?.goOn();
    return;
  }
  const transfer = new Transfer(name, files, (state) => {
    update(id, { state });
    if (state.kind === "done") void refreshDatasets();
  });
  update(id, { transfer });
  await transfer.start(takeOver(transfer));
}

/** An upload that goes on takes the place of the tile that a reload left; returns what that one says is sent. */
function takeOver({ fingerprint }: Transfer): number {
  const isOld = (tile: UploadTile) => tile.leftover?.fingerprint === fingerprint;
  const old = useDatasets.getState().uploads.find(isOld);
  if (old) set(({ uploads }) => ({ uploads: uploads.filter((tile) => !isOld(tile)) }));
  return old?.state.kind === "left" ? old.state.sent : 0;
}

function update(id: number, change: Partial<UploadTile>): void {
  set(({ uploads }) => ({ uploads: uploads.map((tile) => (tile.id === id ? { ...tile, ...change } : tile)) }));
}

async function sceneIn(file: File): Promise<SceneFile | null> {
  if (!/\.json$/i.test(file.name) || file.size > MAX_SCENE_BYTES) return null;
  try {
    const value: unknown = JSON.parse(await file.text());
    return looksLikeScene(value) ? value : null;
  } catch {
    // Not JSON after all: it is uploaded, and the service says what is wrong with it.
    return null;
  }
}
