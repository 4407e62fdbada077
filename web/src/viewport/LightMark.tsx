/** A quiet mark while light is on its way: without it a picture that is dark for a while says nothing of why. */

import { useEffect, useState } from "react";
import { useShallow } from "zustand/react/shallow";
import { useSession } from "../session/store";
import { missingLight } from "./missingLight";

/** Light that comes sooner needs no words, milliseconds. */
const PATIENCE_MILLIS = 500;

export function LightMark() {
  const missing = useSession(useShallow(missingLight));
  const shown = useLasting(missing !== null, PATIENCE_MILLIS) ? missing : null;
  return (
    <>
      {/* Readers of screens are told what goes on; numbers, which change with every picture, wait to be asked for. */}
      <span className="unseen" role="status" data-testid="light-said">{shown?.what}</span>
      {shown && (
        <div className="mark light-mark" role="progressbar" aria-label={shown.what} data-old={shown.old} title={shown.hint} data-testid="light-mark" {...(shown.percent === null ? {} : { "aria-valuenow": shown.percent })} {...(shown.amount === null ? {} : { "aria-valuetext": shown.amount })}>
          <span className="mark-pulse" />
          <span>{shown.what}</span>
          {shown.amount !== null && <span className="number">{shown.amount}</span>}
        </div>
      )}
    </>
  );
}

/** Whether something has been so for this long without a break. */
function useLasting(is: boolean, millis: number): boolean {
  const [lasts, setLasts] = useState(false);
  useEffect(() => {
    if (!is) return;
    const timer = window.setTimeout(() => setLasts(true), millis);
    return () => {
      window.clearTimeout(timer);
      setLasts(false);
    };
  }, [is, millis]);
  return is && lasts;
}
