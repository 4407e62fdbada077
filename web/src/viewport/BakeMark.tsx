/** What light is shown while the scene's own is being baked. */

import { hasBake } from "../quality/bakes";
import { useSession } from "../session/store";
import { lightInWords, showsOldLight } from "../statistics/figures";

export function BakeMark() {
  const bakes = useSession((state) => state.scene !== null && !state.awaitingPicture && state.link === "open" && hasBake(state.scene));
  const old = useSession((state) => showsOldLight(state.frame));
  const light = useSession((state) => lightInWords(state.frame, state.lightMillis));
  if (!bakes || light === null) return null;
  const hint = "What edits of matter touch is baked anew; lights can be turned and changed without that";
  return (
    <div className="mark bake-mark" role="status" data-old={old} title={hint} data-testid="bake-mark">
      <span className="mark-pulse" />
      <span>{old ? "Light of before the edit; baking anew" : "Baking light"}</span>
      <span className="number">{light}</span>
    </div>
  );
}
