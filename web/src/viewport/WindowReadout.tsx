/** Width and middle of the window, while drags in the picture change it. */

import { useSession } from "../session/store";
import { formatData, wholeValues } from "../transfer-function/valueAxis";
import { currentWindow, toggleWindowing, useWindowing } from "./windowing";

export function WindowReadout() {
  const active = useWindowing((windowing) => windowing.active);
  const dataset = useSession((state) => state.dataset);
  // Read anew with every edit of the scene.
  const window = useSession((state) => (state.scene && active ? currentWindow()?.join(" ") : undefined));
  if (window === undefined) return null;
  const [low = 0, high = 0] = window.split(" ").map(Number);
  const whole = wholeValues(dataset);
  return (
    <div className="mark window-readout number" role="status" data-testid="window-readout">
      <span>Window <b>{formatData(high - low, whole)}</b></span>
      <span>Level <b>{formatData((low + high) / 2, whole)}</b></span>
      <button type="button" className="text-button" onClick={toggleWindowing}>Done</button>
    </div>
  );
}
