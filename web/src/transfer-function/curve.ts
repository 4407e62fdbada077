/** What the editor, its menu and its keys do to the scene's transfer function. */

import { baseName, download } from "../app/files";
import { say, sayError } from "../app/say";
import { useUi } from "../app/uiStore";
import type { Material, TransferFunctionPoint } from "../generated/proto";
import { diffPatch, type Patch } from "../scene/mergePatch";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { curveText, onto, placed, readCurve } from "./curveFile";
import { addPoint, insertPoints, removePoints, widestGap } from "./points";
import { recolour, visibleSpan, type ColourAt } from "./recolour";
import { valueRange, type Range } from "./valueAxis";

/** Largest file that is read as a transfer function, bytes. */
const MAX_FILE_BYTES = 1_000_000;

/** The newest copy, for pages without access to the clipboard. */
let copied: string | null = null;

export const setPoints = (points: readonly TransferFunctionPoint[], key: string | null = null): void =>
  session.edit({ transfer_function: { points } }, key);

export const select = (selectedPoints: readonly number[]): void => void useUi.setState({ selectedPoints });

export const selectAll = (): void => select(shown().points.map((_, index) => index));

function shown(): { points: readonly TransferFunctionPoint[]; range: Range } {
  const { scene, dataset } = useSession.getState();
  return { points: scene?.transfer_function.points ?? [], range: valueRange(scene, dataset) };
}

const selection = (): readonly number[] => useUi.getState().selectedPoints;

export function removeSelected(): void {
  if (selection().length === 0) return;
  setPoints(removePoints(shown().points, selection()));
  select([]);
}

/** Adds a point on the curve: at `s`, or where there is most room. */
export function addOnCurve(s: number | null = null): void {
  const { points } = shown();
  const added = addPoint(points, s ?? widestGap(points), null);
  if (added.index < 0) return;
  setPoints(added.points);
  select([added.index]);
}

/** The selected points as text; without a selection the whole curve. */
export function copyText(): string {
  const { points, range } = shown();
  const chosen = points.filter((_, index) => selection().includes(index));
  const part = chosen.length > 0 && chosen.length < points.length;
  copied = curveText(part ? chosen : points, range, useSession.getState().scene?.materials ?? {}, part);
  return copied;
}

/** A patch that makes the scene's materials of these names so; a merge would mix two kinds of surfaces. */
function materialsPatch(materials: Record<string, Material>): Patch {
  const before = useSession.getState().scene?.materials ?? {};
  const patches = Object.entries(materials).map(([name, material]) => [name, diffPatch(before[name] ?? {}, material)] as const);
  return patches.length > 0 ? { materials: Object.fromEntries(patches) } : {};
}

/** Takes a copied or saved transfer function over; points of a part begin at `s`, or stay at their values. */
export function take(text: string, s: number | null = null): void {
  try {
    const read = readCurve(text);
    if (read.kind === "colours") {
      paint(read.at);
      return;
    }
    const { points, range } = shown();
    const materials = materialsPatch(read.materials);
    if (read.part) {
      const inserted = insertPoints(points, placed(read.points, read.range, range, s));
      session.edit({ transfer_function: { points: inserted.points }, ...materials });
      select(inserted.indices);
      return;
    }
    const taken = onto(read.points, read.range, range);
    session.edit({ transfer_function: { points: taken.points }, ...materials });
    select([]);
    if (taken.stretched) say("None of its values occurs here: the curve was stretched over the values of this volume.");
  } catch (error) {
    sayError(error);
  }
}

/** Lays colours over the selected values, or over all that have matter. */
export function paint(colourAt: ColourAt): void {
  const { points } = shown();
  const chosen = points.filter((_, index) => selection().includes(index));
  const [first, last] = [chosen[0]?.s, chosen.at(-1)?.s];
  const span: Range = first !== undefined && last !== undefined && last > first ? [first, last] : visibleSpan(points);
  setPoints(recolour(points, colourAt, span));
  select([]);
}

export async function copyToClipboard(): Promise<void> {
  const text = copyText();
  // No clipboard without HTTPS or permission: the copy still serves this page.
  await (navigator.clipboard as Clipboard | undefined)?.writeText(text).catch(() => undefined);
  say("Copied.");
}

export async function pasteFromClipboard(): Promise<void> {
  const text = await (navigator.clipboard as Clipboard | undefined)?.readText().catch(() => null);
  const newest = text ?? copied;
  if (newest === null) say("There is nothing to paste yet.");
  else take(newest);
}

export function saveCurve(): void {
  const { points, range } = shown();
  const text = curveText(points, range, useSession.getState().scene?.materials ?? {}, false);
  download(new Blob([text], { type: "application/json" }), `${baseName()}.tf.json`);
}

export async function openCurve(file: File): Promise<void> {
  if (file.size > MAX_FILE_BYTES) sayError(new Error(`${file.name} is too large to be a transfer function.`));
  else take(await file.text());
}
