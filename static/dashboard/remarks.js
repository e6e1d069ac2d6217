// What an experimenter can say about an opened session, or to its participant.

/** @typedef {{ title: string, text: string, field: string, confirm: string }} Saying what is asked when words belong to it */
/** @typedef {{ kind: string, path: string, label: string, done: string, saying: Saying | null }} Remark */

/** @type {Remark[]} */
export const REMARKS = [
  {
    kind: "message",
    path: "message",
    label: "Send message",
    done: "The message is on the participant's page.",
    saying: {
      title: "Message to the participant",
      text: "It is shown on the participant's page until they put it away.",
      field: "Message",
      confirm: "Send",
    },
  },
  {
    kind: "task_marked",
    path: "mark",
    label: "Mark this task",
    done: "The task is marked.",
    saying: {
      title: "Mark the task under way",
      text: "The mark is kept in the record with the task and the tick.",
      field: "What is special about it (kept in the lab, never exported)",
      confirm: "Mark",
    },
  },
  {
    kind: "note",
    path: "note",
    label: "Write note",
    done: "The note is kept.",
    saying: {
      title: "Note for the record",
      text: "Notes are kept in the lab beside the session's events. An export says that there is one, not what it says.",
      field: "Note",
      confirm: "Keep note",
    },
  },
  {
    kind: "help_seen",
    path: "help_seen",
    label: "Help is given",
    done: "The call for help is answered.",
    saying: null,
  },
];
