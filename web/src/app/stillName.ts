/** The file name of a still: what is shown, how, and when. */

import type { RenderingMode } from "../generated/proto";

const two = (part: number): string => String(part).padStart(2, "0");

/** `name-slice-20261122-081502.png`, in local time; the usual mode goes without saying. */
export function stillName(name: string, mode: RenderingMode, at: Date): string {
  const day = `${at.getFullYear()}${two(at.getMonth() + 1)}${two(at.getDate())}`;
  const time = `${two(at.getHours())}${two(at.getMinutes())}${two(at.getSeconds())}`;
  return [name, ...(mode === "volume" ? [] : [mode]), day, time].join("-") + ".png";
}
