/**
 * The selected light in the picture: its shape, a handle that moves it and one that aims it. A drag
 * goes parallel to the picture; with Shift, up and down go away from the viewer and towards them.
 */

import { useState } from "react";
import { useUi } from "../app/uiStore";
import type { Light } from "../generated/proto";
import { hexFromLinear } from "../scene/colour";
import { add, scale, type Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { frameOf } from "../viewport/camera";
import { OverlayHandle, type Dragging } from "../viewport/OverlayHandle";
import { inPicture, isInside, pathThrough, seenAt, unitsPerPixel, type ViewportSize } from "../viewport/screen";
import { aimOf, outlineOf } from "./gizmo";
import { aimAt, lightHue, lightNames, moveBy, placeOf, withIds } from "./lights";

/** An arrow key moves a light as far as this many pixels. */
const KEY_PIXELS = 4;

export function LightGizmo({ viewport }: { viewport: ViewportSize }) {
  // While a light is aimed the handle stays under the pointer.
  const [target, setTarget] = useState<Triple | null>(null);
  const selected = useUi((ui) => ui.selectedLight);
  const lights = useSession((state) => state.scene?.lights);
  const camera = useSession((state) => state.scene?.camera);
  const light = selected === null ? undefined : lights?.[selected];
  const place = light && placeOf(light);
  if (!light || !lights || !camera || !place || viewport.height === 0) return null;

  const { right, up, back } = frameOf(camera);
  const change = (to: Light, key: string | null) => session.edit({ lights: withIds(lights).map((item, index) => (index === selected ? { ...to, id: light.id ?? String(index) } : item)) }, key);
  const by = (dx: number, dy: number, shift: boolean, from: Triple) => (shift ? scale(back, dy * unitsPerPixel(camera, viewport, from)) : inPicture(camera, viewport, from, dx, dy));
  const moves = (): Dragging => (dx, dy, shift) => change(moveBy(light, by(dx, dy, shift, place)), null);
  const aim = target ?? aimOf(light);
  const aims = (from: Triple): Dragging => (dx, dy, shift) => {
    const to = add(from, by(dx, dy, shift, from));
    setTarget(to);
    change(aimAt(light, to), null);
  };
  const [placeSeen, aimSeen] = [seenAt(camera, viewport, place), aim && seenAt(camera, viewport, aim)];
  const name = `${lightNames[light.type]} light`;
  const coordinates = (point: Triple) => point.map((x) => x.toFixed(2)).join(", ");
  return (
    <>
      <svg className="overlay-lines" width={viewport.width} height={viewport.height} aria-hidden="true" data-testid="light-outline">
        {outlineOf(light, [right, up]).map(({ points, closed }, index) => <path key={index} d={pathThrough(camera, viewport, points, closed)} />)}
      </svg>
      {placeSeen && isInside(placeSeen, viewport) && (
        <OverlayHandle at={placeSeen} kind="light" fill={hexFromLinear(lightHue(light))} label={`${name}: drag to move, with Shift nearer and farther`} text={coordinates(place)} value={place[0]} testId="light-handle" grab={moves} nudge={(x, y) => change(moveBy(light, by(x * KEY_PIXELS, -y * KEY_PIXELS, false, place)), "move")} />
      )}
      {aim && aimSeen && isInside(aimSeen, viewport) && (
        <OverlayHandle at={aimSeen} kind="aim" label={`${name}: drag to aim`} text={coordinates(aim)} value={aim[0]} testId="light-aim-handle" grab={() => aims(aim)} released={() => setTarget(null)} nudge={(x, y) => change(aimAt(light, add(aim, by(x * KEY_PIXELS, -y * KEY_PIXELS, false, aim))), "aim")} />
      )}
    </>
  );
}
