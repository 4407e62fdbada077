/** A small picture of an export's way, drawn by the service. */

import { useEffect, useState, type ReactNode } from "react";
import type { Camera } from "../generated/proto";
import { askPreview, previewSize } from "../session/previews";

/** Longest edge of such a picture, CSS pixels. */
const PICTURE_EDGE = 132;

/** The size to ask for of pictures of this shape, device pixels. */
export function pictureSize({ width, height }: { width: number; height: number }): { width: number; height: number } {
  const shrink = PICTURE_EDGE / Math.max(width, height);
  return previewSize(Math.max(1, width * shrink), Math.max(1, height * shrink));
}

export function WayPicture({ sessionId, camera, width, height, children }: { sessionId: string; camera: Camera; width: number; height: number; children?: ReactNode }) {
  const [address, setAddress] = useState<string | null>(null);
  const patch = JSON.stringify({ camera: { orthographic_height: null, fov_y_degrees: null, ...camera } });
  useEffect(() => {
    let made: string | null = null;
    const stop = askPreview(sessionId, { patch: JSON.parse(patch) as Record<string, unknown>, width, height }, (blob, stopped) => {
      if (stopped) return;
      made = URL.createObjectURL(blob);
      setAddress(made);
    }, () => undefined); // The words beneath still say what it would be.
    return () => {
      stop();
      if (made !== null) URL.revokeObjectURL(made);
    };
  }, [sessionId, patch, width, height]);
  return (
    <figure data-drawn={address !== null} data-testid="turntable-picture">
      <span style={{ aspectRatio: `${width} / ${height}` }}>{address !== null && <img src={address} alt="" />}</span>
      {children}
    </figure>
  );
}
