// Event targets whose events are known by name, each with what it carries.

/**
 * An EventTarget that knows its events.
 *
 * @template {object} Details what each event carries, by the event's name; null for nothing
 */
export class Emitter extends EventTarget {
  /**
   * @template {keyof Details & string} Name
   * @param {Name} name
   * @param {Details[Name] extends null ? [] : [Details[Name]]} detail nothing for an event that carries null
   * @returns {void}
   */
  emit(name, ...detail) {
    this.dispatchEvent(new CustomEvent(name, { detail: detail[0] }));
  }

  /**
   * @template {keyof Details & string} Name
   * @param {Name} name
   * @param {Listener<Details[Name]>} listener
   * @param {AddEventListenerOptions} [options]
   * @returns {void}
   * @override
   */
  addEventListener(name, listener, options) {
    super.addEventListener(name, /** @type {EventListener} */ (listener), options);
  }

  /**
   * `addEventListener` that returns what takes the listener away again.
   *
   * @template {keyof Details & string} Name
   * @param {Name} name
   * @param {(event: CustomEvent<Details[Name]>) => void} listener
   * @returns {() => void}
   */
  on(name, listener) {
    this.addEventListener(name, listener);
    return () => this.removeEventListener(name, listener);
  }

  /**
   * @template {keyof Details & string} Name
   * @param {Name} name
   * @param {Listener<Details[Name]>} listener
   * @param {EventListenerOptions} [options]
   * @returns {void}
   * @override
   */
  removeEventListener(name, listener, options) {
    super.removeEventListener(name, /** @type {EventListener} */ (listener), options);
  }
}

/**
 * @template Detail
 * @typedef {((event: CustomEvent<Detail>) => void) | EventListenerObject | null} Listener
 */
