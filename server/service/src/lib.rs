//! REST, WebSocket, sessions, storage, encoding.
