/** The views saved for a film, of each session; kept across a reload of the page. */

import { create } from "zustand";
import { createJSONStorage, persist } from "zustand/middleware";
import { useSession } from "../session/store";
import { currentCamera } from "../viewport/actions";
import { FILM_LIMITS, withView, type SavedView } from "./film";

const none: readonly SavedView[] = [];

const useViews = create<{ bySession: Readonly<Record<string, readonly SavedView[]>> }>()(
  persist(() => ({ bySession: {} }), { name: "tyndall.films", storage: createJSONStorage(() => window.sessionStorage) }),
);

/** The views of a session. */
export const useSavedViews = (sessionId: string): readonly SavedView[] => useViews(({ bySession }) => bySession[sessionId] ?? none);

/** Changes the views of the session on screen; how many there are then. */
export function changeViews(change: (views: readonly SavedView[]) => readonly SavedView[]): number {
  const { sessionId } = useSession.getState();
  if (sessionId === null) return 0;
  const { bySession } = useViews.getState();
  const views = change(bySession[sessionId] ?? none);
  useViews.setState({ bySession: { ...bySession, [sessionId]: views } });
  return views.length;
}

/** Keeps the view on screen for a film, as long as there is room; how many views there are then. */
export const keepView = (): number =>
  changeViews((views) => (views.length < FILM_LIMITS.views ? withView(views, currentCamera()) : views));
