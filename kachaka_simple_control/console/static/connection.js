// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/**
 * The WebSocket to the console's server.
 *
 * Messages are JSON objects with `v` and `type` (page_protocol.py). A message with an `id`
 * gets one answer. When nothing has been heard for a while, the page sends a request of its own:
 * an answer shows that the connection works. A socket that has been silent for too long counts as
 * lost even if the browser believes that it is open.
 */

const VERSION = 1;
/** After this silence the page asks for an answer [ms]. */
const ASK_AFTER = 1_000;
/** After this silence the connection counts as lost [ms]. */
const LOST_AFTER = 3_000;
/** How often the silence is checked [ms]. */
const CHECK_PERIOD = 250;
/** How long after a loss the page connects again [ms]. */
const RETRY_AFTER = 1_000;
/** How long a request may take [ms]. */
const ANSWER_WITHIN = {take: 60_000, stop: 60_000, release: 30_000, other: 10_000};
/** The messages that answer a request besides `answer`. */
const REPLIES = ['answer', 'preview', 'file', 'motions'];

/** A connection that opens itself again. Dispatches `open`, `lost` and one event per type. */
export class Connection extends EventTarget {
  /**
   * @param {string} url the address of the WebSocket
   * @param {string} question a request that changes nothing, to hear whether the connection works
   */
  constructor(url, question = 'list') {
    super();
    this.url = url;
    this.question = question;
    this.isOpen = false;
    this.heardAt = 0;
    this.socket = null;
    this.lastRequest = 0;
    this.waiting = new Map();
    this.checkedAt = performance.now();
    this.askedAt = 0;
  }

  /** Connect, and stay connected. */
  start() {
    this.connect();
    setInterval(() => this.check(), CHECK_PERIOD);
  }

  /** Return how long ago the server was heard [ms]; null if there is no connection. */
  get age() {
    return this.isOpen ? performance.now() - this.heardAt : null;
  }

  /**
   * Send a message without an answer.
   * @param {string} type
   * @param {Object} fields
   * @returns {boolean} whether it was passed to the socket
   */
  send(type, fields = {}) {
    if (this.socket === null || this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({v: VERSION, type, ...fields}));
    return true;
  }

  /** Return how many bytes the browser has not passed to the network yet. */
  get backlog() {
    return this.socket === null ? 0 : this.socket.bufferedAmount;
  }

  /**
   * Send a request.
   * @param {string} type
   * @param {Object} fields
   * @returns {Promise<Object>} the answer; `is_done` is false if the connection is lost
   */
  request(type, fields = {}) {
    const id = ++this.lastRequest;
    const refused = (text, more) => ({type: 'answer', id, is_done: false, text, ...more});
    if (!this.send(type, {id, ...fields})) {
      return Promise.resolve(refused(
        'There is no connection to the server.', {isLost: true, isUnsent: true}));
    }
    return new Promise(resolve => {
      const within = ANSWER_WITHIN[type] ?? ANSWER_WITHIN.other;
      const timer = setTimeout(
        () => this.settle(refused(`No answer from the server within ${within / 1_000} s.`, {})),
        within);
      this.waiting.set(id, {resolve, timer});
    });
  }

  /** Resolve the request that a message answers. */
  settle(message) {
    const entry = this.waiting.get(message.id);
    if (entry === undefined) return;
    this.waiting.delete(message.id);
    clearTimeout(entry.timer);
    entry.resolve(message);
  }

  /** Open a new socket. Events of an older one are ignored. */
  connect() {
    const socket = new WebSocket(this.url);
    this.socket = socket;
    this.heardAt = performance.now();
    socket.addEventListener('open', () => {
      if (socket !== this.socket) return;
      this.heardAt = performance.now();
      this.send('hello');
    });
    socket.addEventListener('message', event => {
      if (socket === this.socket) this.receive(event.data);
    });
    socket.addEventListener('close', () => this.lose(socket));
  }

  /** Read one message. */
  receive(data) {
    this.heardAt = performance.now();
    const message = JSON.parse(data);
    if (message.v !== VERSION) return;
    if (!this.isOpen && message.type === 'welcome') {
      this.isOpen = true;
      this.dispatchEvent(new Event('open'));
    }
    this.dispatchEvent(new CustomEvent(message.type, {detail: message}));
    if (REPLIES.includes(message.type)) this.settle(message);
  }

  /** Give up a socket, answer what waits, and connect again. */
  lose(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    this.isOpen = false;
    socket.close();
    for (const id of [...this.waiting.keys()]) {
      this.settle({
        type: 'answer', id, is_done: false, isLost: true,
        text: 'The connection was lost before the answer came.'});
    }
    this.dispatchEvent(new Event('lost'));
    setTimeout(() => this.connect(), RETRY_AFTER);
  }

  /** Ask for an answer after a silence; give the socket up after a longer one. */
  check() {
    const now = performance.now();
    // After this page itself has slept, messages may wait that are not read yet.
    const hasSlept = now - this.checkedAt > 4 * CHECK_PERIOD;
    this.checkedAt = now;
    if (hasSlept) this.heardAt = Math.max(this.heardAt, now - ASK_AFTER);
    if (this.socket === null) return;
    const silence = now - this.heardAt;
    if (silence > LOST_AFTER) {
      this.lose(this.socket);
    } else if (this.isOpen && silence > ASK_AFTER && now - this.askedAt > ASK_AFTER) {
      this.askedAt = now;
      this.request(this.question);
    }
  }
}
