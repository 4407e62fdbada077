/** What an environment light is: one colour or a picture, which way it is turned, whether it is seen. */

import { FileButton, Switch } from "@mantine/core";
import { useEffect, useState, type KeyboardEvent, type PointerEvent } from "react";
import { environmentPreviewUrl } from "../api/rest";
import { NumberField, Row } from "../app/controls";
import { Icon } from "../app/Icon";
import { saySideEffect } from "../app/sideEffect";
import { useUi } from "../app/uiStore";
import type { Environment } from "../generated/proto";
import { hexFromLinear } from "../scene/colour";
import type { Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import {
  choosePicture, columnBehind, meanRadiance, pictureOfScene, takesPictures, turnOf, withoutPicture, withTurn, wrapped, type EnvironmentLight,
} from "./environments";
import { refreshEnvironments, removeEnvironment, takeEnvironment, useEnvironments } from "./environmentStore";

/** Turn of an arrow key, degrees; Shift takes more. */
const KEY_DEGREES = 2;
const SHIFT_KEY_DEGREES = 15;
/** Browser tests put files here. */
const fileInput = { "data-testid": "environment-file", "aria-label": "Environment file" } as object;

interface DetailProps {
  light: EnvironmentLight;
  index: number;
  onChange: (light: EnvironmentLight, key: string) => void;
}

export function EnvironmentDetail({ light, index, onChange }: DetailProps) {
  const background = useSession((state) => state.scene?.background);
  const chosen = useEnvironments(({ list }) => list?.find(({ id }) => id === light.image));
  return (
    <div className="environment">
      <Tiles light={light} index={index} onChange={onChange} />
      {light.image !== undefined && <Strip light={light} image={light.image} onChange={onChange} />}
      {chosen?.notices.map((notice) => <p key={notice} className="hint">{notice}</p>)}
      <Row label="Background">
        <Switch checked={background === "environment"} label="Show behind the volume" data-testid="environment-behind" onChange={(event) => session.edit({ background: event.currentTarget.checked ? "environment" : [0, 0, 0] })} />
      </Row>
    </div>
  );
}

/** As bright as the light is, up to white. */
const uniformColour = ({ radiance = [1, 1, 1] }: EnvironmentLight): string => hexFromLinear(radiance.map((x) => Math.min(1, x)) as Triple);

/** Lights the scene by a picture, and says so where that changes the method. */
function choose(index: number, image: string): void {
  const { scene, dataset } = useSession.getState();
  if (!scene) return;
  const { patch, switched } = choosePicture(scene, index, image, dataset?.anatomical ?? false);
  session.edit(patch);
  if (!switched) return;
  saySideEffect("lights", "Environment pictures need Path traced; the method was switched.", (now) => takesPictures(now.illumination.method) && pictureOfScene(now) !== null);
}

function Tiles({ light, index, onChange }: DetailProps) {
  const { list, uploading, problem } = useEnvironments();
  const method = useSession((state) => state.scene?.illumination.method);
  const sideEffect = useUi((ui) => (ui.sideEffect?.at === "lights" ? ui.sideEffect.text : null));
  const [removing, setRemoving] = useState<Environment | null>(null);
  useEffect(() => void refreshEnvironments(), []);
  const known = light.image === undefined || !list || list.some(({ id }) => id === light.image);
  const uniform = withoutPicture(light, meanRadiance(list, light.image));
  const open = async (file: File | null) => {
    const taken = file && (await takeEnvironment(file));
    if (taken) choose(index, taken.id);
  };
  return (
    <>
      <div className="environment-tiles" role="group" aria-label="Light from all around" data-testid="environments">
        <Tile name="Uniform" chosen={light.image === undefined} testId="environment-uniform" background={uniformColour(uniform)} onChoose={() => light.image !== undefined && onChange(uniform, "picture")} />
        {list?.map((environment) => (
          <Tile
            key={environment.id} name={environment.name} chosen={environment.id === light.image} testId={`environment-${environment.id}`} preview={environment.id}
            onChoose={() => environment.id !== light.image && choose(index, environment.id)}
            // Nobody takes away the picture they look at.
            {...(environment.sample || environment.id === light.image ? {} : { onRemove: () => setRemoving(environment) })}
          />
        ))}
        <FileButton accept=".hdr,.exr" inputProps={fileInput} onChange={(file) => void open(file)}>
          {(props) => (
            <button type="button" className="environment-tile" title="A picture of light: Radiance HDR (.hdr) or OpenEXR (.exr), all directions in one picture twice as wide as high" disabled={uploading !== null} data-testid="environment-open" {...props}>
              <span className="environment-picture environment-plus"><Icon name="plus" size={14} /></span>
              <span className="environment-name">{uploading === null ? "Open …" : "Reading …"}</span>
            </button>
          )}
        </FileButton>
      </div>
      {removing && (
        <div className="environment-removing" role="alertdialog" aria-label={`Delete ${removing.name}?`}>
          <span>Delete {removing.name} from the service? Links to scenes lit by it will not open.</span>
          <button type="button" className="text-button" data-testid="environment-delete-confirm" onClick={() => {
            setRemoving(null);
            void removeEnvironment(removing.id);
          }}>Delete</button>
          <button type="button" className="text-button" onClick={() => setRemoving(null)}>Keep</button>
        </div>
      )}
      {!known && <p className="note" role="status">The picture of this light is no longer on the service. The light stays until the session rests; choose another.</p>}
      {problem !== null && (
        <p className="note note-danger" role="alert" data-testid="environment-problem">
          {problem}
          <button type="button" className="note-close" aria-label="Dismiss" onClick={() => useEnvironments.setState({ problem: null })}><Icon name="close" size={10} /></button>
        </p>
      )}
      {sideEffect !== null && <p className="note" role="status" data-testid="environment-note">{sideEffect}</p>}
      {sideEffect === null && method !== undefined && !takesPictures(method) && <p className="hint">Environment pictures need Path traced: choosing one switches the method.</p>}
    </>
  );
}

function Tile({ name, chosen, preview, background, testId, onChoose, onRemove }: {
  name: string;
  chosen: boolean;
  /** Identifier of the environment whose picture is shown; else `background`. */
  preview?: string;
  background?: string;
  testId: string;
  onChoose: () => void;
  onRemove?: () => void;
}) {
  return (
    <div className="environment-cell">
      <button type="button" className="environment-tile" title={name} aria-pressed={chosen} onClick={onChoose} data-testid={testId}>
        <span className="environment-picture" style={background === undefined ? undefined : { background }}>
          {preview !== undefined && <img src={environmentPreviewUrl(preview)} alt="" width={256} height={128} />}
        </span>
        <span className="environment-name">{name}</span>
      </button>
      {onRemove && <button type="button" className="environment-remove" title={`Delete ${name}`} aria-label={`Delete ${name}`} onClick={onRemove} data-testid={`${testId}-delete`}><Icon name="close" size={9} /></button>}
    </div>
  );
}

/** The whole picture; its middle is what lies behind the volume. Dragged sideways, it turns with the pointer. */
function Strip({ light, image, onChange }: { light: EnvironmentLight; image: string; onChange: DetailProps["onChange"] }) {
  const camera = useSession((state) => state.scene?.camera);
  const anatomical = useSession((state) => state.dataset?.anatomical ?? false);
  const [from, setFrom] = useState<{ x: number; turn: number; degreesPerPixel: number } | null>(null);
  const turn = turnOf(light, anatomical);
  const turnTo = (degrees: number) => onChange(withTurn(light, degrees, anatomical), "turn");
  const begin = (event: PointerEvent<HTMLDivElement>) => {
    if (event.button !== 0) return;
    event.currentTarget.setPointerCapture(event.pointerId);
    session.beginGesture();
    setFrom({ x: event.clientX, turn, degreesPerPixel: 360 / event.currentTarget.getBoundingClientRect().width });
  };
  const end = () => {
    setFrom(null);
    session.endGesture();
  };
  const key = (event: KeyboardEvent) => {
    const step = event.shiftKey ? SHIFT_KEY_DEGREES : KEY_DEGREES;
    const by = { ArrowLeft: -step, ArrowRight: step, ArrowDown: -step, ArrowUp: step }[event.key];
    if (by === undefined && event.key !== "Home") return;
    event.preventDefault();
    turnTo(by === undefined ? 0 : turn + by);
  };
  // Two copies side by side, moved to the left until the wanted column is in the middle.
  const shift = camera ? (((columnBehind(light, camera, anatomical) - 0.5) % 1) + 1) % 1 : 0;
  return (
    <>
      <div
        className="environment-strip"
        title="Drag sideways to turn the light. The middle is what lies behind the volume."
        tabIndex={0}
        role="slider"
        aria-label="Turn of the environment"
        aria-orientation="horizontal"
        aria-valuemin={-180}
        aria-valuemax={180}
        aria-valuenow={Math.round(turn)}
        aria-valuetext={`turned ${Math.abs(Math.round(turn))} degrees to the ${turn < 0 ? "left" : "right"}`}
        data-testid="environment-strip"
        onPointerDown={begin}
        onPointerMove={(event) => from && turnTo(from.turn + (event.clientX - from.x) * from.degreesPerPixel)}
        onPointerUp={end}
        onPointerCancel={end}
        onKeyDown={key}
      >
        <span className="environment-around" style={{ backgroundImage: `url("${environmentPreviewUrl(image)}")`, transform: `translateX(${-50 * shift}%)` }} />
      </div>
      <Row label="Turn" hint="Degrees to the right; drag the strip, or use arrow keys on it">
        <NumberField label="Turn" value={turn} min={-360} max={360} step={1} digits={5} suffix="°" testId="light-turn" onChange={(degrees) => turnTo(wrapped(degrees))} />
      </Row>
    </>
  );
}
