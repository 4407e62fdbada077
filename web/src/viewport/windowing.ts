/** Window and level by dragging in the picture: across changes the width, up and down the middle. */

import { create } from "zustand";
import type { SceneFile } from "../generated/proto";
import { rounded } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { valueRange, type Range } from "../transfer-function/valueAxis";

/** Dragging over the whole width multiplies the window's width by e to this power. */
const WIDTH_PER_VIEWPORT = 3;
/** Dragging over the whole height moves the middle by this many widths of the window. */
const LEVEL_PER_VIEWPORT = 1.5;
/** Narrowest and widest window, shares of the data's range. */
const WIDTHS: Range = [1e-3, 4];

/** The tool that takes plain drags in the picture for the window. */
export const useWindowing = create<{ active: boolean }>(() => ({ active: false }));

export const toggleWindowing = (): void => useWindowing.setState(({ active }) => ({ active: !active }));

/** Modes whose greys have a window of their own; the others take the transfer function along. */
export const hasGreyWindow = ({ rendering }: Pick<SceneFile, "rendering">): boolean => rendering.mode !== "volume" && rendering.mode !== "isosurface";

/** The window after a drag, in shares of the viewport, upwards counted positive. */
export function dragged([low, high]: Range, right: number, up: number, data: Range): [number, number] {
  const span = data[1] - data[0];
  const width = Math.min(Math.max((high - low) * Math.exp(right * WIDTH_PER_VIEWPORT), WIDTHS[0] * span), WIDTHS[1] * span);
  // As on a scanner: upwards darkens, because the middle rises.
  const middle = (low + high) / 2 + up * LEVEL_PER_VIEWPORT * (high - low);
  const kept = Math.min(Math.max(middle, data[0]), data[1]);
  return [rounded(kept - width / 2), rounded(kept + width / 2)];
}

/** The window that drags change. */
export function currentWindow(): Range | null {
  const { scene, dataset } = useSession.getState();
  if (!scene) return null;
  const all = valueRange(scene, dataset);
  return hasGreyWindow(scene) ? (scene.rendering.window ?? all) : all;
}

export function moveWindow(right: number, up: number, key: string | null = null): void {
  const { scene, dataset } = useSession.getState();
  const window = currentWindow();
  if (!scene || !window) return;
  const to = dragged(window, right, up, dataset?.value_range ?? window);
  session.edit(hasGreyWindow(scene) ? { rendering: { window: to } } : { value_range: to }, key);
}
