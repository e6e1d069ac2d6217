// What our own scripts put on the window: for the console, and for the tests that drive a browser.

/** How a fake gamepad is made: its slot, and how many axes and buttons it has. */
interface FakeShape {
  index?: number;
  axes?: number;
  buttons?: number;
}

/** The hand on the fake gamepad (tests/support/fake_gamepad.js). */
interface FakeHand {
  connect(id?: string, mapping?: GamepadMappingType, shape?: FakeShape): void;
  disconnect(): void;
  value(index: number, value: number): void;
  press(index: number): void;
  release(index: number): void;
  axis(index: number, value: number): void;
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
  __padBoot?: { device: (FakeShape & { id: string; mapping?: GamepadMappingType }) | null };
  __seen?: SeenMessages;
}
