// What our own scripts put on the window: for the console, and for the tests that drive a browser.

/** How a fake gamepad is made: its slot, and how many axes and buttons it has. */
interface FakeShape {
  index?: number;
  axes?: number;
  buttons?: number;
}

/** A fake gamepad that is plugged in. */
interface FakeDevice extends FakeShape {
  id: string;
  mapping?: GamepadMappingType;
}

/** The hand on the fake gamepads (tests/support/fake_gamepad.js). */
interface FakeHand {
  connect(id?: string, mapping?: GamepadMappingType, shape?: FakeShape): void;
  disconnect(slot?: number | null): void;
  value(index: number, value: number, slot?: number | null): void;
  press(index: number, slot?: number | null): void;
  release(index: number, slot?: number | null): void;
  axis(index: number, value: number, slot?: number | null): void;
  state(): { plugged: boolean; exposed: boolean; activated: boolean };
}

/** What came over the page's sockets (tests/support/telemetry.js). */
interface SeenMessages {
  counts: Record<string, number>;
  last: Record<string, object>;
  frames: string[];
}

interface Window {
  /** The page's own objects. */
  salab?: object;
  __pad?: FakeHand;
  /** What is plugged in when a document begins. */
  __padBoot?: { devices: FakeDevice[] };
  __seen?: SeenMessages;
}
