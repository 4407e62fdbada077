/** Says that this page looks and does not edit, and how to edit all the same. */

import { Button } from "@mantine/core";
import { session } from "../session/engine";
import { isWatching, useSession } from "../session/store";
import { sayError } from "./say";

export function WatchBar() {
  const watching = useSession(isWatching);
  if (!watching) return null;
  const copy = () => {
    const { scene } = useSession.getState();
    if (scene) void session.openScene(scene).catch(sayError);
  };
  return (
    <div className="watch-bar" role="status" data-testid="watch-bar">
      <span>You are watching. Your view is your own; the scene is its editors’.</span>
      <Button variant="default" size="compact-xs" title="A session of your own with the scene on screen" onClick={copy} data-testid="watch-copy">Make a copy to edit</Button>
    </div>
  );
}
