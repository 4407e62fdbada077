/** A small cube that turns with the view; a click on a face looks from there. */

import { useSession } from "../session/store";
import { lookAt } from "./actions";
import { toView } from "./camera";
import { standardViews } from "./views";

/** Half the cube's edge, CSS pixels. */
const HALF = 19;
/** Cosine to the viewer below which a face is too narrow for its letter. */
const LETTER_MIN_FACING = 0.45;

export function OrientationCube() {
  const camera = useSession((state) => state.scene?.camera);
  const anatomical = useSession((state) => state.dataset?.anatomical ?? false);
  if (!camera) return null;
  return (
    <div className="cube" data-testid="orientation-cube">
      {standardViews(anatomical).map((view) => {
        // The face's axes on screen (CSS y points down, z towards the viewer).
        const z = toView(camera, view.from);
        const y = toView(camera, view.up);
        const x = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]];
        const [xx = 0, xy = 0, xz = 0] = x;
        const matrix = [xx, -xy, xz, 0, -y[0], y[1], -y[2], 0, z[0], -z[1], z[2], 0, z[0] * HALF, -z[1] * HALF, z[2] * HALF, 1];
        return (
          <button
            key={view.name}
            type="button"
            tabIndex={-1}
            className="cube-face"
            data-front={z[2] > 0.5}
            hidden={z[2] <= 0.02}
            style={{ transform: `matrix3d(${matrix.map((value) => value.toFixed(5)).join(",")})` }}
            title={view.label}
            aria-label={`${view.letter}: view from ${view.label}`}
            data-testid={`cube-${view.name}`}
            onClick={() => lookAt(view)}
          >
            {z[2] > LETTER_MIN_FACING && view.letter}
          </button>
        );
      })}
    </div>
  );
}
