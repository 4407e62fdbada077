/** The lights: list, the selected one in detail, rigs. */

import { Button, Menu } from "@mantine/core";
import { useEffect, useRef } from "react";
import { environmentPreviewUrl } from "../api/rest";
import { ColorField, IconButton, NumberField, Row, Section, SliderField, TripleField } from "../app/controls";
import { Icon } from "../app/Icon";
import { useUi } from "../app/uiStore";
import { MAX_LIGHTS, type Light } from "../generated/proto";
import type { Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { currentCamera } from "../viewport/actions";
import { fromView, toView } from "../viewport/camera";
import { DirectionSphere } from "./DirectionSphere";
import { EnvironmentDetail } from "./EnvironmentDetail";
import { pictureOf } from "./environments";
import {
  aimAt, comeFrom, freeId, lightHue, lightNames, lightStrength, newLight, placeOf, quantityOf, setHue, setPlace, setStrength,
  towardsLight, withIds, type LightType,
} from "./lights";
import { rigs } from "./rigs";

/** Strength at the end of the slider, and the scene's own limit. */
const SLIDER_STRENGTH = 30;
const MAX_STRENGTH = 1e9;
/** Where a new light comes from, view axes: from the upper left. */
const NEW_LIGHT_FROM: [number, number, number] = [-0.7, 0.8, 0.8];

const setLights = (lights: Light[], key: string | null = null): void => session.edit({ lights }, key);
const select = (selectedLight: number | null): void => void useUi.setState({ selectedLight });

export function LightsPanel() {
  const lights = useSession((state) => state.scene?.lights);
  const selected = useUi((ui) => ui.selectedLight);
  if (!lights) return null;

  const change = (index: number, to: Light, key: string | null = null) => setLights(withIds(lights).map((light, i) => (i === index ? { ...to, id: light.id ?? String(i) } : light)), key);
  const addLight = (type: LightType) => {
    const named = withIds(lights);
    setLights([...named, newLight(type, fromView(currentCamera(), NEW_LIGHT_FROM), freeId(named, type))]);
    select(lights.length);
  };
  return (
    <Section id="lights" title="Lights" fields={["lights"]} actions={<AddLight lights={lights} onAdd={addLight} />}>
      <div className="rigs">
        {rigs.map((rig) => (
          <Button key={rig.id} variant="default" size="compact-xs" title={`${rig.hint}. Takes the place of all lights.`} data-testid={`rig-${rig.id}`} onClick={() => {
            setLights(rig.lights(currentCamera()));
            select(null);
          }}>
            {rig.label}
          </Button>
        ))}
      </div>
      <ul className="light-list" data-testid="lights">
        {lights.map((item, index) => (
          <li key={item.id ?? index} className="light-item" data-selected={index === selected}>
            <div className="light-row" data-testid={`light-${index}`} data-type={item.type} data-enabled={item.enabled}>
              <LightSwatch light={item} index={index} onHue={(hue) => change(index, setHue(item, hue), `hue-${index}`)} />
              <button type="button" className="light-name" title={`${lightNames[item.type]} ${item.id ?? index}: place and details`} aria-expanded={index === selected} onClick={() => select(index === selected ? null : index)} data-testid={`light-select-${index}`}>
                <span>{lightNames[item.type]}</span>
                <span className="light-id">{item.id ?? index}</span>
              </button>
              <NumberField label="Strength" value={lightStrength(item)} min={0} max={MAX_STRENGTH} step={0.1} digits={3} width={52} testId={`light-strength-${index}`} onChange={(strength) => change(index, setStrength(item, strength), `strength-${index}`)} />
              <IconButton icon={item.enabled ? "eye" : "eyeOff"} label={item.enabled ? "Switch off" : "Switch on"} testId={`light-enabled-${index}`} onClick={() => change(index, { ...item, enabled: !item.enabled })} />
              <IconButton icon="close" label="Remove" testId={`light-remove-${index}`} onClick={() => {
                setLights(withIds(lights).filter((_, i) => i !== index));
                select(null);
              }} />
            </div>
            {index === selected && <LightDetail light={item} index={index} onChange={(to, key) => change(index, to, `${key}-${index}`)} />}
          </li>
        ))}
      </ul>
      {lights.length === 0 && <p className="hint">No lights: only emission is seen. Add one, or take a set above.</p>}
    </Section>
  );
}

/** The colour of a light; what has a picture shows that instead. */
function LightSwatch({ light, index, onHue }: { light: Light; index: number; onHue: (hue: Triple) => void }) {
  const image = pictureOf(light);
  if (image === null) return <ColorField label="Colour of the light" color={lightHue(light)} testId={`light-colour-${index}`} onChange={onHue} />;
  return <span className="swatch swatch-picture" style={{ backgroundImage: `url("${environmentPreviewUrl(image)}")` }} />;
}

function AddLight({ lights, onAdd }: { lights: readonly Light[]; onAdd: (type: LightType) => void }) {
  const hasEnvironment = lights.some((light) => light.type === "environment");
  return (
    <Menu position="bottom-end" withinPortal>
      <Menu.Target>
        <Button variant="default" size="compact-xs" leftSection={<Icon name="plus" size={11} />} disabled={lights.length >= MAX_LIGHTS} data-testid="light-add">Add</Button>
      </Menu.Target>
      <Menu.Dropdown>
        {(Object.keys(lightNames) as LightType[]).map((type) => (
          <Menu.Item key={type} disabled={type === "environment" && hasEnvironment} onClick={() => onAdd(type)} data-testid={`light-add-${type}`}>
            {lightNames[type]}
            {type === "environment" && hasEnvironment && <span className="dim"> (one at most)</span>}
          </Menu.Item>
        ))}
      </Menu.Dropdown>
    </Menu>
  );
}

function LightDetail({ light, index, onChange }: { light: Light; index: number; onChange: (light: Light, key: string) => void }) {
  const camera = useSession((state) => state.scene?.camera);
  const towards = towardsLight(light);
  const place = placeOf(light);
  const panel = useRef<HTMLDivElement>(null);
  // It opens under its light, which may stand at the lower end of the panel.
  useEffect(() => {
    panel.current?.scrollIntoView({ block: "nearest" });
  }, []);
  return (
    <div className="light-detail" ref={panel} data-testid="light-detail">
      {light.type === "environment" && <EnvironmentDetail light={light} index={index} onChange={onChange} />}
      {towards && camera && <DirectionSphere towards={toView(camera, towards)} onChange={(direction) => onChange(comeFrom(light, fromView(camera, direction)), "direction")} />}
      <div className="light-numbers">
        <SliderField label="Strength" hint={quantityOf(light)} value={lightStrength(light)} min={0} max={MAX_STRENGTH} sliderMax={SLIDER_STRENGTH} step={0.1} toSlider={Math.sqrt} fromSlider={(x) => x * x} testId="light-strength" onChange={(strength) => onChange(setStrength(light, strength), "strength")} />
        {place && <TripleField label="Position" value={place} testId="light-position" onChange={(to) => onChange(setPlace(light, to), "place")} />}
        {(light.type === "spot" || light.type === "disk" || light.type === "rectangle") && (
          <Row label="Aim"><Button variant="default" size="compact-xs" onClick={() => onChange(aimAt(light, [0, 0, 0]), "aim")} data-testid="light-aim">At the centre</Button></Row>
        )}
        {light.type === "spot" && <Pair label="Cone" hint="Half-angles in degrees: full inside the first, dark beyond the second" names={["inner", "outer"]} value={light.cone_degrees} max={180} step={1} onChange={(cone_degrees) => onChange({ ...light, cone_degrees }, "cone")} />}
        {light.type === "rectangle" && <Pair label="Size" hint="Edge lengths in world units" names={["width", "height"]} value={light.size} max={100} step={0.05} onChange={(size) => onChange({ ...light, size }, "size")} />}
        {(light.type === "disk" || light.type === "sphere") && (
          <Row label="Radius"><NumberField label="Radius" value={light.radius} min={0} max={100} step={0.02} testId="light-radius" onChange={(radius) => onChange({ ...light, radius }, "radius")} /></Row>
        )}
      </div>
    </div>
  );
}

function Pair({ label, hint, names, value, max, step, onChange }: {
  label: string;
  hint: string;
  names: [string, string];
  value: [number, number];
  max: number;
  step: number;
  onChange: (value: [number, number]) => void;
}) {
  return (
    <Row label={label} hint={hint}>
      <NumberField label={`${label} ${names[0]}`} value={value[0]} min={0} max={max} step={step} testId={`light-${names[0]}`} onChange={(first) => onChange([first, value[1]])} />
      <NumberField label={`${label} ${names[1]}`} value={value[1]} min={0} max={max} step={step} testId={`light-${names[1]}`} onChange={(second) => onChange([value[0], second])} />
    </Row>
  );
}
