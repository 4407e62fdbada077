/** One table of keys: it drives the handler and the help sheet. */

import { stepSlice } from "../quality/slicing";
import { session } from "../session/engine";
import { isWatching, useSession } from "../session/store";
import { keepView } from "../turntable/savedViews";
import { pivotAtMiddle, toggleMeasuring } from "../viewport/probing";
import { moveWindow, toggleWindowing, useWindowing } from "../viewport/windowing";
import { lookAtNumber, resetView, toggleFullScreen, turn, zoomStep } from "../viewport/actions";
import { saveStill } from "./files";
import { say, sayError } from "./say";
import { useUi } from "./uiStore";

interface Binding {
  /** `KeyboardEvent.key`, and whether Shift must be held (left open: either). */
  keys: string[];
  shift?: boolean;
  shown: string;
  does: string;
  /** Of no use to those who watch. */
  edits?: true;
  run: (key: string) => void;
}

const flipLeft = (): void => useUi.getState().togglePanel("left");
const flipRight = (): void => useUi.getState().togglePanel("right");

/** Share of the viewport that an arrow key drags the window by. */
const KEY_WINDOW = 0.02;

/** Turns the view; while the window is dragged in the picture, changes the window. */
function arrow(x: number, y: number): void {
  if (useWindowing.getState().active) moveWindow(x * KEY_WINDOW, -y * KEY_WINDOW, "window-keys");
  else turn(x, y);
}

/** Keeps the view on screen, and says so. */
function keepForFilm(): void {
  if (!useSession.getState().scene) return;
  const count = keepView();
  useUi.setState({ filmChosen: true });
  say(`${count === 1 ? "One view is" : `${count} views are`} kept for a film: T shows them.`);
}

export const bindings: readonly Binding[] = [
  { keys: ["ArrowLeft"], shown: "←", does: "Turn left", run: () => arrow(-1, 0) },
  { keys: ["ArrowRight"], shown: "→", does: "Turn right", run: () => arrow(1, 0) },
  { keys: ["ArrowUp"], shown: "↑", does: "Turn up", run: () => arrow(0, -1) },
  { keys: ["ArrowDown"], shown: "↓", does: "Turn down", run: () => arrow(0, 1) },
  { keys: ["+", "="], shown: "+", does: "Nearer", run: () => zoomStep(1) },
  { keys: ["-", "_"], shown: "−", does: "Farther", run: () => zoomStep(-1) },
  { keys: ["1", "2", "3", "4", "5", "6"], shown: "1 – 6", does: "Front, back, left, right, top, bottom", run: (key) => lookAtNumber(Number(key)) },
  { edits: true, keys: ["PageUp"], shown: "Page ↑", does: "Next slice, where one is shown", run: () => stepSlice(1) },
  { edits: true, keys: ["PageDown"], shown: "Page ↓", does: "Slice before", run: () => stepSlice(-1) },
  { keys: ["r"], shown: "R", does: "Back to the starting view", run: resetView },
  { keys: ["p"], shown: "P", does: "Pivot on what is in the middle", run: () => void pivotAtMiddle() },
  { keys: ["f"], shown: "F", does: "Full screen", run: () => void toggleFullScreen().catch(sayError) },
  { keys: ["s"], shown: "S", does: "Save a still as PNG", run: () => void saveStill() },
  { keys: ["t"], shown: "T", does: "Turntable or film: a camera that moves, as a file", run: () => void useUi.setState(({ turntableOpen }) => ({ turntableOpen: !turntableOpen })) },
  { keys: ["v"], shown: "V", does: "Keep this view for a film", run: keepForFilm },
  { keys: ["m"], shown: "M", does: "Measure a distance: press two places", run: toggleMeasuring },
  { edits: true, keys: ["w"], shown: "W", does: "Window and level: drag in the picture, or arrow keys", run: toggleWindowing },
  { edits: true, keys: ["c"], shown: "C", does: "Handles of the clip box and planes", run: () => void useUi.setState((ui) => ({ clipHandles: !ui.clipHandles })) },
  { edits: true, keys: ["z"], shift: false, shown: "Z or Ctrl Z", does: "Undo", run: () => session.undo() },
  { edits: true, keys: ["z"], shift: true, shown: "Shift Z or Ctrl Shift Z", does: "Redo", run: () => session.redo() },
  { keys: ["["], shown: "[", does: "Fold the left panel", run: flipLeft },
  { keys: ["]"], shown: "]", does: "Fold the right panel", run: flipRight },
  { keys: ["g"], shown: "G", does: "Sessions on this server", run: () => void useUi.setState(({ galleryOpen }) => ({ galleryOpen: !galleryOpen })) },
  { keys: ["i"], shown: "I", does: "Statistics", run: () => void useUi.setState((ui) => ({ statisticsOpen: !ui.statisticsOpen })) },
  { keys: ["?"], shown: "?", does: "This sheet", run: () => void useUi.setState((ui) => ({ helpOpen: !ui.helpOpen })) },
];

/** Elements that use letters, and those that use arrows. A closed list of choices is an input that nobody types in. */
const TYPING = "input:not([type=range], [type=checkbox], [type=radio], [readonly]:not([aria-expanded=true])), textarea, select, [contenteditable=true], [role=dialog]";
const STEPPING = "[role=slider], [role=listbox], [role=radiogroup], [role=menu]";

export function handleKey(event: KeyboardEvent): void {
  if (event.defaultPrevented || event.altKey) return;
  const target = event.target instanceof Element ? event.target : document.body;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  // Ctrl/Cmd with Z works like the plain key; other combinations belong to the browser.
  if ((event.ctrlKey || event.metaKey) && key !== "z") return;
  if (target.closest(TYPING) && !(key === "?" && target.closest("[data-help]"))) return;
  if (key.startsWith("Arrow") && target.closest(STEPPING)) return;
  const binding = bindings.find(({ keys, shift }) => keys.includes(key) && (shift === undefined || shift === event.shiftKey));
  if (!binding || (binding.edits && isWatching(useSession.getState()))) return;
  event.preventDefault();
  binding.run(key);
}
