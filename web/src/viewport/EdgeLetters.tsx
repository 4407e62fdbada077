/** The patient's sides at the four edges of the picture, where the data are anatomical. */

import { useSession } from "../session/store";
import { edgeLetters, type Edge } from "./patientSides";

export function EdgeLetters() {
  const camera = useSession((state) => state.scene?.camera);
  const anatomical = useSession((state) => state.dataset?.anatomical ?? false);
  if (!camera || !anatomical) return null;
  return (Object.entries(edgeLetters(camera)) as [Edge, string][]).map(([edge, letter]) => (
    <span key={edge} className="edge-letter" data-edge={edge} data-testid={`edge-${edge}`}>{letter}</span>
  ));
}
