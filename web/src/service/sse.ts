/** Server-sent events read through `fetch`, since `EventSource` cannot send a token (HTML standard, "Server-sent events"). */

export interface ServerEvent {
  readonly type: string;
  /** The last id seen, which `Last-Event-ID` takes. */
  readonly id: string;
  readonly data: string;
}

/** Longest line that is waited for; events of the service have some hundred characters. */
const MAX_CHARACTERS = 1 << 20;

/** Takes the text of an event stream in pieces and gives the events that are whole. */
export class EventParser {
  #rest = '';
  #type = '';
  #id = '';
  #data: string[] = [];

  push(text: string): ServerEvent[] {
    this.#rest += text;
    const events: ServerEvent[] = [];
    // A carriage return at the very end may be the first half of a line end.
    const lines = this.#rest.split(/\r\n|\n|\r(?!$)/);
    this.#rest = lines.pop() ?? '';
    if (this.#rest.length > MAX_CHARACTERS) throw new Error('The service sent an event without an end.');
    for (const line of lines) {
      const event = line === '' ? this.#dispatch() : this.#field(line);
      if (event) events.push(event);
    }
    return events;
  }

  #field(line: string): null {
    const colon = line.indexOf(':');
    const name = colon < 0 ? line : line.slice(0, colon);
    const value = colon < 0 ? '' : line.slice(colon + 1).replace(/^ /, '');
    if (name === 'event') this.#type = value;
    else if (name === 'data') this.#data.push(value);
    else if (name === 'id' && !value.includes('\0')) this.#id = value;
    return null;
  }

  #dispatch(): ServerEvent | null {
    const [type, data] = [this.#type || 'message', this.#data];
    this.#type = '';
    this.#data = [];
    return data.length > 0 ? { type, id: this.#id, data: data.join('\n') } : null;
  }
}
