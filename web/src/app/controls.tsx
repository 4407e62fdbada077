/** Controls that every panel uses. */

import { ColorPicker, NumberInput, Popover, Slider, Tooltip, ActionIcon } from "@mantine/core";
import { useEffect, useId, useRef, useState, type ReactNode } from "react";
import { hexFromLinear, linearFromHex } from "../scene/colour";
import { clamp, rounded, type Triple } from "../scene/vec";
import { session } from "../session/engine";
import { isWatching, useSession } from "../session/store";
import { rootOf } from "../session/words";
import { Icon, type IconName } from "./Icon";
import { valueAfterKey } from "./sliderKeys";
import { useUi, type SectionId } from "./uiStore";

/** Sections that are not about the scene: those who watch use them, too. */
const NOT_OF_THE_SCENE: readonly SectionId[] = ["samples", "mine"];

/** A part of a side panel that folds; those who watch can read and not change it. Refused edits of the scene members in `fields` are shown in it. */
export function Section({ id, title, fields = [], actions, children }: {
  id: SectionId;
  title: string;
  fields?: readonly string[];
  actions?: ReactNode;
  children: ReactNode;
}) {
  const open = useUi((ui) => !ui.closedSections.includes(id));
  const toggle = useUi((ui) => ui.toggleSection);
  const locked = useSession(isWatching) && !NOT_OF_THE_SCENE.includes(id);
  const body = useId();
  return (
    <section className="section" data-testid={`section-${id}`} data-open={open}>
      <header className="section-head">
        <button type="button" className="section-title" aria-expanded={open} aria-controls={body} onClick={() => toggle(id)} data-testid={`section-toggle-${id}`}>
          <Icon name="chevron" size={12} />
          {title}
        </button>
        {open && !locked && actions}
      </header>
      <FieldNote fields={fields} />
      {open && <div className="section-body" id={body} inert={locked}>{children}</div>}
    </section>
  );
}

/** Why the server refused the last edit of one of these members of the scene. */
export function FieldNote({ fields }: { fields: readonly string[] }) {
  const error = useSession((state) => state.fieldError);
  if (!error || !fields.includes(rootOf(error.field))) return null;
  return (
    <p className="note note-danger" role="alert" data-testid="field-error" data-field={error.field}>
      {error.message}
      <button type="button" className="note-close" aria-label="Dismiss" onClick={() => useSession.setState({ fieldError: null })}>
        <Icon name="close" size={10} />
      </button>
    </p>
  );
}

export function Row({ label, hint, children }: { label: string; hint?: string; children: ReactNode }) {
  const text = <span className="row-label" data-hint={hint !== undefined}>{label}</span>;
  return (
    <div className="row">
      {hint === undefined ? text : <Tooltip label={hint}>{text}</Tooltip>}
      <div className="row-control">{children}</div>
    </div>
  );
}

interface NumberFieldProps {
  label: string;
  value: number;
  onChange: (value: number) => void;
  min?: number;
  max?: number;
  step?: number;
  digits?: number;
  width?: number;
  suffix?: string;
  /** Shown as a whole number, whatever `digits` says. */
  whole?: boolean;
  /** Passed on with Enter or on leaving: the numbers on the way to it would do harm. */
  whenDone?: boolean;
  testId: string;
}

/**
 * A number; values in range are passed on as they are typed. While it is typed the text is the
 * person's: what the scene makes of it (a point stops at its neighbour) is shown afterwards.
 */
export function NumberField({ label, value, onChange, min = -Infinity, max = Infinity, step = 0.1, digits = 4, width = 68, suffix, whole = false, whenDone = false, testId }: NumberFieldProps) {
  const [draft, setDraft] = useState<number | string | null>(null);
  const waiting = useRef<number | null>(null);
  // A value that had been taken and is then something else was taken back: the server refused it.
  const passedOn = useRef<number | null>(null);
  const written = whole ? Math.round(value) : rounded(value, digits);
  const pass = (number: number) => {
    if (!Number.isFinite(number) || number < min || number > max || number === written) return;
    passedOn.current = number;
    onChange(number);
  };
  const finish = () => {
    if (waiting.current !== null) pass(waiting.current);
    waiting.current = null;
    setDraft(null);
  };
  const shown = useRef(value);
  useEffect(() => {
    if (shown.current === passedOn.current && value !== passedOn.current) setDraft(null);
    shown.current = value;
  }, [value]);
  return (
    <NumberInput
      aria-label={label}
      data-testid={testId}
      w={width}
      value={draft ?? written}
      step={whole ? Math.max(1, Math.round(step)) : step}
      hideControls
      clampBehavior="none"
      {...(min === -Infinity ? {} : { min })}
      {...(max === Infinity ? {} : { max })}
      {...(suffix === undefined ? {} : { suffix })}
      onBlur={finish}
      onKeyDown={(event) => {
        if (event.key === "Enter") finish();
        if (event.key === "Escape") {
          waiting.current = null;
          event.currentTarget.blur();
        }
      }}
      onChange={(next) => {
        setDraft(next);
        const number = typeof next === "number" ? next : Number.NaN;
        if (whenDone) waiting.current = number;
        else pass(number);
      }}
    />
  );
}

/** Most places of a slider. */
const SLIDER_PLACES = 400;
/** Widths of the number beside a slider, pixels: of few digits, and of counts up to millions. */
const NUMBER_WIDTH = 58;
const COUNT_WIDTH = 76;
/** Counts from here on are long. */
const LONG_COUNT = 100_000;

/** A slider with its number. One drag is one undo step. */
export function SliderField({ label, hint, value, onChange, min, max, step, toSlider = identity, fromSlider = identity, digits = 3, sliderMax, whole = false, testId }: {
  label: string;
  hint?: string;
  value: number;
  onChange: (value: number) => void;
  min: number;
  max: number;
  step: number;
  /** Value to slider position and back, where the slider is not linear. */
  toSlider?: (value: number) => number;
  fromSlider?: (position: number) => number;
  digits?: number;
  /** The slider may end before the number does. */
  sliderMax?: number;
  whole?: boolean;
  testId: string;
}) {
  const low = toSlider(min);
  const high = toSlider(sliderMax ?? max);
  const finest = (high - low) / SLIDER_PLACES;
  const ofWholes = whole || Number.isInteger(step);
  const shown = clamp(toSlider(value), low, high);
  // The slider tells where it goes and not what made it go.
  const byKey = useRef(false);
  return (
    <Row label={label} {...(hint === undefined ? {} : { hint })}>
      <div className="row-slider" onKeyDownCapture={() => (byKey.current = true)} onKeyDown={() => (byKey.current = false)}>
        <Slider
          min={low}
          max={high}
          step={ofWholes && toSlider === identity ? Math.max(1, finest) : finest}
          label={null}
          value={shown}
          thumbLabel={label}
          onChange={(position) => {
            session.beginGesture();
            const led = ofWholes ? Math.round(fromSlider(position)) : rounded(fromSlider(position), digits);
            onChange(byKey.current ? valueAfterKey(value, led, [shown, position], { unit: ofWholes ? 1 : 0, min, max }) : led);
          }}
          onChangeEnd={() => session.endGesture()}
          data-testid={`${testId}-slider`}
        />
      </div>
      <NumberField label={label} value={value} onChange={onChange} min={min} max={max} step={step} width={whole && max >= LONG_COUNT ? COUNT_WIDTH : NUMBER_WIDTH} whole={whole} testId={testId} />
    </Row>
  );
}

const identity = (value: number): number => value;

/** A swatch that opens a picker with the colours used before. Colours are linear. */
export function ColorField({ label, color, onChange, testId }: {
  label: string;
  color: Triple;
  onChange: (color: Triple) => void;
  testId: string;
}) {
  const [opened, setOpened] = useState(false);
  const recent = useUi((ui) => ui.recentColours);
  const hex = hexFromLinear(color);
  const pick = (text: string) => {
    const linear = linearFromHex(text);
    if (linear && text !== hex) onChange(linear);
  };
  const typed = (text: string) => {
    if (text === hex || !linearFromHex(text)) return;
    pick(text);
    useUi.getState().usedColour(text);
  };
  return (
    <Popover opened={opened} onChange={setOpened} position="left" withinPortal trapFocus>
      <Popover.Target>
        <button type="button" className="swatch" style={{ background: hex }} aria-label={`${label}: ${hex}`} title={`${label} ${hex}`} data-testid={testId} data-color={hex} onClick={() => setOpened((is) => !is)} />
      </Popover.Target>
      <Popover.Dropdown p={8}>
        <ColorPicker
          value={hex}
          format="hex"
          swatches={recent}
          swatchesPerRow={7}
          onChange={(text) => {
            session.beginGesture();
            pick(text);
          }}
          onChangeEnd={(text) => {
            session.endGesture();
            useUi.getState().usedColour(text);
          }}
        />
        <input
          className="hex-input"
          aria-label={`${label} as hexadecimal sRGB`}
          defaultValue={hex}
          key={hex}
          spellCheck={false}
          data-testid={`${testId}-hex`}
          onKeyDown={(event) => {
            if (event.key === "Enter") typed(event.currentTarget.value);
          }}
          onBlur={(event) => typed(event.currentTarget.value)}
        />
      </Popover.Dropdown>
    </Popover>
  );
}

/** A button that is only an icon, with its name and key in the tooltip. */
export function IconButton({ icon, label, hotkey, onClick, disabled = false, active = false, testId }: {
  icon: IconName;
  label: string;
  hotkey?: string;
  onClick: () => void;
  disabled?: boolean;
  active?: boolean;
  testId: string;
}) {
  return (
    <Tooltip label={hotkey === undefined ? label : <>{label} <kbd>{hotkey}</kbd></>}>
      {/* Not `disabled`, which would keep the tooltip away that may say why. */}
      <ActionIcon color="gray" aria-label={label} aria-pressed={active} aria-disabled={disabled} data-active={active} {...(disabled ? { "data-disabled": true } : { onClick })} data-testid={testId}>
        <Icon name={icon} />
      </ActionIcon>
    </Tooltip>
  );
}

/** Three numbers in a row. */
export function TripleField({ label, value, onChange, step = 0.05, testId }: {
  label: string;
  value: Triple;
  onChange: (value: Triple) => void;
  step?: number;
  testId: string;
}) {
  return (
    <Row label={label}>
      {(["x", "y", "z"] as const).map((axis, index) => (
        <NumberField
          key={axis}
          label={`${label} ${axis}`}
          value={value[index] ?? 0}
          step={step}
          width={56}
          digits={3}
          testId={`${testId}-${axis}`}
          onChange={(number) => {
            const next: Triple = [...value];
            next[index] = number;
            onChange(next);
          }}
        />
      ))}
    </Row>
  );
}
