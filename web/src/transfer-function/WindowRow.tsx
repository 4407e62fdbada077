/** A window of data values in two numbers. */

import { NumberField, Row } from "../app/controls";
import type { Range } from "./valueAxis";

export function WindowRow({ hint, range, whole, onChange, onReset, testId }: {
  hint: string;
  range: Range;
  whole: boolean;
  onChange: (range: [number, number]) => void;
  /** Back to all values; null where they are shown. */
  onReset: (() => void) | null;
  testId: string;
}) {
  const [low, high] = range;
  const step = (high - low) / 100;
  return (
    <Row label="Window" hint={`${hint}; Enter takes a number over`}>
      <NumberField label="Window from" value={low} max={high} digits={6} width={78} step={step} whole={whole} whenDone testId={`${testId}-low`} onChange={(to) => onChange([to, high])} />
      <NumberField label="Window to" value={high} min={low} digits={6} width={78} step={step} whole={whole} whenDone testId={`${testId}-high`} onChange={(to) => onChange([low, to])} />
      {onReset && <button type="button" className="text-button" title="All values of the data" onClick={onReset} data-testid={`${testId}-reset`}>All</button>}
    </Row>
  );
}
