/** Every key and gesture on one sheet. */

import { Modal } from "@mantine/core";
import { bindings } from "./keyboard";
import { useUi } from "./uiStore";

const pointer: readonly [string, string][] = [
  ["Drag", "Turn"],
  ["Shift or middle drag", "Move"],
  ["Wheel or right drag", "Zoom at the pointer"],
  ["Double-click", "Pivot on what is there; beside it, back to the centre"],
  ["One finger · two fingers", "Turn · move and pinch"],
];

const editor: readonly [string, string][] = [
  ["Drag a point", "Value and opacity; Shift locks one"],
  ["Drag between points", "Move both"],
  ["Double-click", "Add a point"],
  ["Delete", "Remove the selected point"],
  ["Arrow keys", "Nudge; Shift for ten times"],
  ["Right-click", "Exact numbers"],
  ["Wheel", "Zoom the values at the pointer"],
  ["Double-click the axis", "Show all values"],
];

function Table({ title, rows }: { title: string; rows: readonly (readonly [string, string])[] }) {
  return (
    <section>
      <h3>{title}</h3>
      <dl>
        {rows.map(([key, does]) => (
          <div key={key + does}>
            <dt>{key}</dt>
            <dd>{does}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}

export function HelpSheet() {
  const opened = useUi((ui) => ui.helpOpen);
  return (
    <Modal opened={opened} onClose={() => useUi.setState({ helpOpen: false })} title="Keys and gestures" size={760} data-testid="help-sheet" data-help>
      <div className="help">
        <Table title="Keys" rows={bindings.map(({ shown, does }) => [shown, does] as const)} />
        <div>
          <Table title="Picture" rows={pointer} />
          <Table title="Transfer function" rows={editor} />
        </div>
      </div>
    </Modal>
  );
}
