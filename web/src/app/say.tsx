/** Short messages that concern no control in particular. */

import { notifications } from "@mantine/notifications";
import { wordsOf } from "../session/words";

/** How long a message stays, milliseconds. */
const NOTICE_MILLIS = 3500;
const ERROR_MILLIS = 9000;

export const say = (message: string): void => {
  notifications.show({ message, autoClose: NOTICE_MILLIS, withBorder: true });
};

/** A message with something to press, which puts it away. */
export const offer = (message: string, does: string, run: () => void): void => {
  const id = notifications.show({
    autoClose: ERROR_MILLIS,
    withBorder: true,
    message: (
      <>
        {message} <button type="button" className="text-button" data-testid="offer" onClick={() => {
          notifications.hide(id);
          run();
        }}>{does}</button>
      </>
    ),
  });
};

export const sayError = (error: unknown): void => {
  notifications.show({ message: wordsOf(error), autoClose: ERROR_MILLIS, color: "red", withBorder: true });
};
