/** What keys and buttons do to the view. */

import type { Camera } from "../generated/proto";
import type { Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { lookFrom, nearestAxis, orbit, toOrthographic, toPerspective, zoom } from "./camera";
import { defaultCamera, standardViews, type StandardView } from "./views";

/** Turn of one arrow key press, radians. */
const KEY_ORBIT = Math.PI / 36;
/** Zoom of one key press. */
const KEY_ZOOM = 0.9;

/** This viewer's camera; the starting one until the server has sent a scene. */
export function currentCamera(): Camera {
  const { scene, startCamera, dataset } = useSession.getState();
  return scene?.camera ?? startCamera ?? defaultCamera(dataset);
}

export const startUp = (): Triple => useSession.getState().startCamera?.up ?? currentCamera().up;

export const turn = (x: number, y: number): void =>
  session.moveCamera(orbit(currentCamera(), x * KEY_ORBIT, y * KEY_ORBIT, nearestAxis(startUp())));

export const zoomStep = (direction: 1 | -1): void => session.moveCamera(zoom(currentCamera(), KEY_ZOOM ** direction, 0, 0));

export const lookAt = (view: StandardView): void => session.moveCamera(lookFrom(currentCamera(), view.from, view.up));

export function lookAtNumber(number: number): void {
  const view = standardViews(useSession.getState().dataset?.anatomical ?? false)[number - 1];
  if (view) lookAt(view);
}

export const resetView = (): void => session.resetView();

export function toggleProjection(): void {
  const camera = currentCamera();
  const fov = useSession.getState().startCamera?.fov_y_degrees;
  session.moveCamera(camera.orthographic_height === undefined ? toOrthographic(camera) : toPerspective(camera, fov));
}

export async function toggleFullScreen(): Promise<void> {
  if (document.fullscreenElement) await document.exitFullscreen();
  else await document.documentElement.requestFullscreen();
}
