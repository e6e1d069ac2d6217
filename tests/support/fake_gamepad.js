// A fake gamepad for headless tests: no virtual one exists, so navigator.getGamepads is replaced before the page's
// own scripts run (add this file as an init script). What the page sees behaves as in Chromium:
//
// - slots: an array, as long as the browser's own, with null in each slot that has no pad;
// - activation: nothing is exposed until a button is pressed in this document (moving an axis is not enough);
//   then `gamepadconnected` is fired on window with a GamepadEvent, and the pad is in its slot already;
// - snapshots: the array is new in every call, the Gamepad in it is replaced when something changes and never
//   changes itself: code that keeps one and does not ask again sees stale values, as it would in Chromium;
// - instances: `pad instanceof Gamepad`, `pad.buttons[0] instanceof GamepadButton`, both read-only;
// - `timestamp` moves when, and only when, a button or an axis changes;
// - disconnect: the slot becomes null, the event's pad says connected = false.
//
// The hand on the pad is window.__pad (tests/support/fake_pad.py drives it):
//   connect(id, mapping, {index, axes, buttons}), disconnect(), press(i), release(i), value(i, v), axis(i, v), state()
//
// A pad stays plugged in across reloads: fake_pad.py leaves window.__padBoot in later documents, which are then
// gated anew, as in a real browser.
/** @typedef {{ id: string, mapping: GamepadMappingType, index: number, timestamp: number, axes: number[], buttons: number[] }} Device */
(() => {
  if (window.__pad) return;
  const nativeList = navigator.getGamepads.bind(navigator);
  const slotCount = nativeList().length || 4;
  /** @type {Device | null} */
  let device = null; // what is plugged in, exposed or not
  /** @type {Gamepad | null} */
  let exposed = null; // the current snapshot, null until activated
  let activated = false;
  let lastStamp = 0;

  /**
   * An object of the browser's own kind.
   *
   * @template {object} Kind
   * @param {Kind} prototype
   * @param {{ [Name in keyof Kind]: Kind[Name] | null }} values
   * @returns {Kind}
   */
  const readOnly = (prototype, values) => {
    const object = Object.create(prototype);
    for (const [name, value] of Object.entries(values)) {
      Object.defineProperty(object, name, { get: () => value, enumerable: true });
    }
    return object;
  };

  const snapshot = (/** @type {Device} */ device, connected = true) =>
    readOnly(Gamepad.prototype, {
      id: device.id,
      index: device.index,
      connected,
      timestamp: device.timestamp,
      mapping: device.mapping,
      axes: Object.freeze([...device.axes]),
      buttons: Object.freeze(
        device.buttons.map((value) =>
          readOnly(GamepadButton.prototype, { pressed: value >= 0.5, touched: value > 0, value }),
        ),
      ),
      vibrationActuator: null,
    });

  const fire = (/** @type {string} */ type, /** @type {Gamepad} */ gamepad) => {
    // The constructor wants a Gamepad of the browser's own making, so the pad is put on the event afterwards.
    const event = new GamepadEvent(type);
    Object.defineProperty(event, "gamepad", { get: () => gamepad, enumerable: true });
    window.dispatchEvent(event);
  };

  const expose = (/** @type {Device} */ pad) => {
    exposed = snapshot(pad);
    fire("gamepadconnected", exposed);
  };

  const changed = (/** @type {Device} */ pad) => {
    lastStamp = Math.max(performance.now(), lastStamp + 0.001); // never twice the same, even with a coarse clock
    pad.timestamp = lastStamp;
    if (exposed) exposed = snapshot(pad);
  };

  // Read as late as possible: init scripts run in no promised order.
  const replug = () => {
    if (!device && window.__padBoot?.device) plugIn(window.__padBoot.device);
  };

  /** @returns {Device} */
  const plugged = () => {
    replug();
    if (!device) throw new Error("no pad is plugged in: call __pad.connect(id, mapping) first");
    return device;
  };

  const checked = (/** @type {number[]} */ list, /** @type {number} */ index, /** @type {string} */ what) => {
    if (!Number.isInteger(index) || index < 0 || index >= list.length) {
      throw new RangeError(`${what} ${index}: this pad has ${what} 0 to ${list.length - 1}`);
    }
  };

  /** @param {NonNullable<NonNullable<Window["__padBoot"]>["device"]>} wanted */
  const plugIn = ({ id, mapping = "standard", index = 0, axes = 4, buttons = 17 }) => {
    if (!["standard", "", "xr-standard"].includes(mapping)) throw new TypeError(`mapping "${mapping}"`);
    if (!Number.isInteger(index) || index < 0 || index >= slotCount) {
      throw new RangeError(`index ${index}: this browser has slots 0 to ${slotCount - 1}`);
    }
    lastStamp = Math.max(performance.now(), lastStamp + 0.001);
    device = {
      id,
      mapping,
      index,
      timestamp: lastStamp,
      axes: Array(axes).fill(0),
      buttons: Array(buttons).fill(0),
    };
    if (activated) expose(device); // a document that saw a press before sees a new pad at once
  };

  /** @type {FakeHand} */
  const hand = {
    connect: (id = "Fake Pad (Vendor: 054c Product: 0268)", mapping = "standard", shape = {}) => {
      replug();
      if (device) throw new Error(`a pad is plugged in already: ${device.id}`);
      plugIn({ id, mapping, ...shape });
    },

    disconnect: () => {
      const pad = plugged();
      const gone = exposed && snapshot(pad, false);
      device = null;
      exposed = null;
      if (window.__padBoot) window.__padBoot = { ...window.__padBoot, device: null };
      if (gone) fire("gamepaddisconnected", gone);
    },

    value: (index, value) => {
      const pad = plugged();
      checked(pad.buttons, index, "button");
      const next = Math.min(1, Math.max(0, value));
      if (pad.buttons[index] === next) return;
      pad.buttons[index] = next;
      changed(pad);
      if (!exposed && next >= 0.5) {
        activated = true;
        expose(pad);
      }
    },
    press: (index) => hand.value(index, 1),
    release: (index) => hand.value(index, 0),

    axis: (index, value) => {
      const pad = plugged();
      checked(pad.axes, index, "axis");
      const next = Math.min(1, Math.max(-1, value));
      if (pad.axes[index] === next) return;
      pad.axes[index] = next;
      changed(pad);
    },

    state: () => {
      replug();
      return { plugged: device !== null, exposed: exposed !== null, activated };
    },
  };

  window.__pad = Object.freeze(hand);
  Object.defineProperty(Navigator.prototype, "getGamepads", {
    value: function getGamepads() {
      /** @type {(Gamepad | null)[]} */
      const list = Array(slotCount).fill(null);
      if (exposed) list[exposed.index] = exposed;
      return list;
    },
    writable: true,
    enumerable: true,
    configurable: true,
  });
})();
