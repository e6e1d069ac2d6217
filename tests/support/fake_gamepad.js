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
// - first values: 0 for every axis and button, until it is reported.
//
// The hand on the pads is window.__pad (tests/support/fake_pad.py drives it), each pad by its slot, the first when none is named:
//   connect(id, mapping, {index, axes, buttons}), disconnect(slot), press(i, slot), release(i, slot), value(i, v, slot),
//   axis(i, v, slot), state()
//
// A pad stays plugged in across reloads: fake_pad.py leaves window.__padBoot in later documents, which are then
// gated anew, as in a real browser.
/** @typedef {{ id: string, mapping: GamepadMappingType, index: number, timestamp: number, axes: number[], buttons: number[] }} Device */
(() => {
  if (window.__pad) return;
  const nativeList = navigator.getGamepads.bind(navigator);
  const slotCount = nativeList().length || 4;
  /** @type {Map<number, Device>} */
  const devices = new Map(); // what is plugged in, exposed or not, by slot
  /** @type {Map<number, Gamepad>} */
  const exposed = new Map(); // the current snapshots, none until activated
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
    const seen = snapshot(pad);
    exposed.set(pad.index, seen);
    fire("gamepadconnected", seen);
  };

  const changed = (/** @type {Device} */ pad) => {
    lastStamp = Math.max(performance.now(), lastStamp + 0.001); // never twice the same, even with a coarse clock
    pad.timestamp = lastStamp;
    if (exposed.has(pad.index)) exposed.set(pad.index, snapshot(pad));
  };

  // Read as late as possible: init scripts run in no promised order.
  let booted = false;
  const replug = () => {
    if (booted) return;
    booted = true;
    for (const device of window.__padBoot?.devices ?? []) plugIn(device);
  };

  /** @returns {Device} */
  const plugged = (/** @type {number | null} */ slot) => {
    replug();
    const device = slot === null ? [...devices.values()][0] : devices.get(slot);
    if (!device) throw new Error("no pad is plugged in: call __pad.connect(id, mapping) first");
    return device;
  };

  const checked = (/** @type {number[]} */ list, /** @type {number} */ index, /** @type {string} */ what) => {
    if (!Number.isInteger(index) || index < 0 || index >= list.length) {
      throw new RangeError(`${what} ${index}: this pad has ${what} 0 to ${list.length - 1}`);
    }
  };

  /** @param {FakeDevice} wanted */
  const plugIn = ({ id, mapping = "standard", index = 0, axes = 4, buttons = 17 }) => {
    if (!["standard", "", "xr-standard"].includes(mapping)) throw new TypeError(`mapping "${mapping}"`);
    if (!Number.isInteger(index) || index < 0 || index >= slotCount) {
      throw new RangeError(`index ${index}: this browser has slots 0 to ${slotCount - 1}`);
    }
    lastStamp = Math.max(performance.now(), lastStamp + 0.001);
    const device = {
      id,
      mapping,
      index,
      timestamp: lastStamp,
      axes: Array(axes).fill(0),
      buttons: Array(buttons).fill(0),
    };
    devices.set(index, device);
    if (activated) expose(device); // a document that saw a press before sees a new pad at once
  };

  /** @type {FakeHand} */
  const hand = {
    connect: (id = "Fake Pad (Vendor: 054c Product: 0268)", mapping = "standard", shape = {}) => {
      replug();
      const there = devices.get(shape.index ?? 0);
      if (there) throw new Error(`a pad is plugged in already: ${there.id}`);
      plugIn({ id, mapping, ...shape });
    },

    disconnect: (slot = null) => {
      const pad = plugged(slot);
      const gone = exposed.has(pad.index) && snapshot(pad, false);
      devices.delete(pad.index);
      exposed.delete(pad.index);
      if (gone) fire("gamepaddisconnected", gone);
    },

    value: (index, value, slot = null) => {
      const pad = plugged(slot);
      checked(pad.buttons, index, "button");
      const next = Math.min(1, Math.max(0, value));
      if (pad.buttons[index] === next) return;
      pad.buttons[index] = next;
      changed(pad);
      if (!activated && next >= 0.5) {
        activated = true;
        for (const device of devices.values()) expose(device);
      }
    },
    press: (index, slot) => hand.value(index, 1, slot),
    release: (index, slot) => hand.value(index, 0, slot),

    axis: (index, value, slot = null) => {
      const pad = plugged(slot);
      checked(pad.axes, index, "axis");
      if (pad.axes[index] === value) return;
      pad.axes[index] = value; // beyond ±1 too: so reads a D-pad on one axis
      changed(pad);
    },

    state: () => {
      replug();
      return { plugged: devices.size > 0, exposed: exposed.size > 0, activated };
    },
  };

  window.__pad = Object.freeze(hand);
  Object.defineProperty(Navigator.prototype, "getGamepads", {
    value: function getGamepads() {
      /** @type {(Gamepad | null)[]} */
      const list = Array(slotCount).fill(null);
      for (const [slot, pad] of exposed) list[slot] = pad;
      return list;
    },
    writable: true,
    enumerable: true,
    configurable: true,
  });
})();
