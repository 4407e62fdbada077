/** The selected light as a handle in the picture; dragging it moves the light parallel to the screen. */

import { useRef, type PointerEvent } from "react";
import { useUi } from "../app/uiStore";
import { hexFromLinear } from "../scene/colour";
import { add, scale } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { frameOf, heightAtPivot, project, toView } from "../viewport/camera";
import { lightHue, lightNames, moveBy, placeOf, withIds } from "./lights";

export function LightHandle({ viewport }: { viewport: { width: number; height: number } }) {
  const last = useRef<{ x: number; y: number } | null>(null);
  const selected = useUi((ui) => ui.selectedLight);
  const lights = useSession((state) => state.scene?.lights);
  const camera = useSession((state) => state.scene?.camera);
  const light = selected === null ? undefined : lights?.[selected];
  const place = light && placeOf(light);
  const seen = camera && place ? project(camera, place) : null;
  if (!light || !lights || !camera || !place || !seen) return null;

  const x = viewport.width / 2 + seen[0] * viewport.height;
  const y = viewport.height / 2 - seen[1] * viewport.height;
  const inside = x > 0 && y > 0 && x < viewport.width && y < viewport.height;
  if (!inside) return null;

  const drag = (event: PointerEvent) => {
    const from = last.current;
    if (!from) return;
    last.current = { x: event.clientX, y: event.clientY };
    const { right, up, distance } = frameOf(camera);
    // World units per pixel at the light's own depth.
    const depth = camera.orthographic_height === undefined ? (distance - toView(camera, place)[2] + toView(camera, camera.target)[2]) / distance : 1;
    const k = (heightAtPivot(camera) * depth) / viewport.height;
    const by = add(scale(right, (event.clientX - from.x) * k), scale(up, (from.y - event.clientY) * k));
    session.edit({ lights: withIds(lights).map((item, index) => (index === selected ? moveBy(item, by) : item)) });
  };
  return (
    <div
      className="light-handle"
      style={{ left: x, top: y, background: hexFromLinear(lightHue(light)) }}
      title={`${lightNames[light.type]} light: drag to move`}
      data-testid="light-handle"
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        last.current = { x: event.clientX, y: event.clientY };
        session.beginGesture();
      }}
      onPointerMove={drag}
      onPointerUp={() => {
        last.current = null;
        session.endGesture();
      }}
    />
  );
}
