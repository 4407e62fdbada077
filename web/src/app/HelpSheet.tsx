/** Every key and gesture on one sheet. */

import { Modal } from "@mantine/core";
import { bindings } from "./keyboard";
import { useUi } from "./uiStore";

type Rows = readonly (readonly [string, string])[];

const pointer: Rows = [
  ["Drag", "Turn"],
  ["Shift or middle drag", "Move"],
  ["Wheel or right drag", "Zoom at the pointer"],
  ["Ctrl drag", "Window and level"],
  ["Double-click", "Pivot on what is there; beside it, back to the centre"],
  ["One finger · two fingers", "Turn · move and pinch"],
];

const handles: Rows = [
  ["Drag", "Pull a face or plane, move or aim the light"],
  ["Shift drag", "The light: nearer and farther"],
  ["Strip of an environment", "Drag sideways, or arrow keys: turns it; Shift for more, Home back"],
  ["Tab, arrow keys", "From handle to handle; moves it, Shift for ten times"],
];

const editor: Rows = [
  ["Drag a point", "Value and opacity; Shift locks one"],
  ["Drag under the curve", "Move both points beside it"],
  ["Drag above it, Ctrl drag", "Select the points in a rectangle"],
  ["Shift-click", "Select one more point"],
  ["Double-click", "Add a point"],
  ["Right-click", "Exact numbers"],
  ["Wheel, pinch", "Zoom the values; Shift and wheel moves them"],
  ["Double-click the axis", "Show all values"],
];

const editorKeys: Rows = [
  ["Tab", "From point to point"],
  ["Space", "Marks this point together with others"],
  ["Arrow keys", "Nudge what is selected; Shift for ten times"],
  ["N · Delete", "Add a point · remove what is selected"],
  ["Enter", "Exact numbers"],
  ["+ · − · 0", "Zoom the values · show all"],
  ["Ctrl A · C · X · V", "Select all, copy, cut, paste at the pointer"],
];

function Table({ title, rows }: { title: string; rows: Rows }) {
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
    <Modal opened={opened} onClose={() => useUi.setState({ helpOpen: false })} title="Keys and gestures" size={1130} closeButtonProps={{ "aria-label": "Close" }} data-testid="help-sheet" data-help>
      <div className="help">
        <Table title="Keys" rows={bindings.map(({ shown, does }) => [shown, does] as const)} />
        <div>
          <Table title="Picture" rows={pointer} />
          <Table title="Handles in the picture" rows={handles} />
        </div>
        <div>
          <Table title="Transfer function" rows={editor} />
          <Table title="Keys in the transfer function" rows={editorKeys} />
        </div>
      </div>
    </Modal>
  );
}
