/** What an edit changed besides what was asked for: said where it was asked for, until it no longer holds. */

import type { SceneFile } from "../generated/proto";
import { useSession } from "../session/store";
import { useUi } from "./uiStore";

/** How long it is said, milliseconds. */
const NOTE_MILLIS = 15_000;

/** Says it for some time, and no longer than `holds` is true of the scene: an undo takes it away, too. */
export function saySideEffect(at: "method" | "lights", text: string, holds: (scene: SceneFile) => boolean): void {
  const sideEffect = { at, text };
  useUi.setState({ sideEffect });
  const end = () => {
    stopWatching();
    window.clearTimeout(timer);
    if (useUi.getState().sideEffect === sideEffect) useUi.setState({ sideEffect: null });
  };
  const timer = window.setTimeout(end, NOTE_MILLIS);
  const stopWatching = useSession.subscribe(({ scene }) => {
    if (!scene || !holds(scene)) end();
  });
}
