// The REST API: JSON requests; what goes wrong is a Problem (RFC 9457) with a text for people.

const BASE = new URL("api/v1/", document.baseURI);

export const address = (path) => new URL(path, BASE);

export class Problem extends Error {
  constructor({ status = 0, title = "Request failed", detail = "", ...members } = {}) {
    super(detail || title);
    Object.assign(this, { status, title, members });
  }
}

export const NO_ANSWER = {
  title: "No answer from the server",
  detail: "The server did not answer. Check that it is running; the page reconnects by itself.",
};

/** Sends a request with a JSON body, if any. See `send`. */
export function request(method, path, body) {
  if (body === undefined) return send(method, path);
  return send(method, path, { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } });
}

/** Sends a request as it is; resolves to the parsed answer, null if it has no body. Throws Problem. */
export async function send(method, path, options = {}) {
  const { ok, status, text } = await answerTo(path, { method, ...options });
  if (!ok) throw problemOf(status, text);
  return text ? JSON.parse(text) : null;
}

async function answerTo(path, options) {
  try {
    const response = await fetch(address(path), options);
    return { ok: response.ok, status: response.status, text: await response.text() };
  } catch {
    throw new Problem(NO_ANSWER);
  }
}

/** The Problem an error answer carries, or one made of its status where it carries none. */
export function problemOf(status, text) {
  try {
    return new Problem({ status, ...JSON.parse(text) });
  } catch {
    return new Problem({ status, title: `The server answered ${status}`, detail: text.slice(0, 300) });
  }
}
