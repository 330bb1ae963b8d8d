"""Every refusal of an import is listed with the observation that establishes it."""

from tests.analysis.logs.refusals import sentences

ESTABLISHED_BY = {
    "bag_log": {
        "a field exceeds its header": "its size is over the bytes left",
        "a header has an invalid field": "a field without =",
        "a record exceeds its chunk": "its size is over the bytes left",
        "a record of {} bytes": "its size is over 64 MiB",
        "over {} topics": "the count of connections",
        "the file is cut there": "the file ends before the size of a record",
    },
    "channels": {
        "message {} of {} does not match its type ({}).": "a count or size that the "
        "bytes of the message do not hold",
        "over {} messages of {}.": "the count",
        "{} jumps {} s after its first message: joint {} of the leg goes from {} to {} "
        "in {} ms.": "a step of over 0.02 that needs over 30 rad/s or m/s; both values",
        "{} of {} messages of {} have the stamp of another one.": "distinct stamps are "
        "under 90 % of them",
        "{} of {} stamps of {} are not set.": "the count of stamps of 0",
        "{} topics of {}.{}": "the count of topics of the type",
        "{} usable messages of {} of {}{}.": "the counts, by cause",
        "{} was received at {} times for {} messages, which does not distinguish the "
        "messages.": "distinct receipts are under 90 % of the messages",
        "{} {} {}.": "the topic is missing, or its type is another one",
    },
    "checks": {"{}": "a sentence of signs; the checks that disagree are put before it"},
    "clocks": {
        "{}.": "the line through receipt less stamp: offset, drift with its interval, "
        "largest lasting step"
    },
    "importing": {
        "--along and --normal are the same direction.": "under 6 degrees between both",
        "--lag {} ms is beyond {} ms.": "the number stated",
        "--tare {}:{} holds {} readings.": "rows with a reading between both times",
        "--trials {}:{} holds {} rows.": "rows between both times",
        "{} {}:{} is not within the log.": "a time before the first row or after the "
        "last",
        "{} has {} Hz, the least is {} Hz.": "the median step of its times",
    },
    "leg_record": {
        "this is a trial of Traction: report, fit and export read it.": "a topic of "
        "traction_msgs/Cycle",
        "No reading of the wrench lies at a time of the joints: the joints go from 0 "
        "to {} s, the wrench from {} to {} s.": "no row of the joints has a reading; "
        "both spans",
    },
    "log_file": {
        "cannot be copied ({})": "what the system says",
        "cannot be read ({})": "what the system says",
        "{} GB, the limit is {} GB": "the size on the disk",
        "{} of {} bytes, the limit is {}": "the size of a name",
        "{}.": "the sentence of the caller",
    },
    "mcap_log": {
        "over {} topics": "the count of channels",
        "over {} types": "the count of schemas",
    },
    "messages": {
        "it begins with {}, not as plain CDR": "its first two bytes",
        "it is shorter than its type": "a number ends behind the message",
        "it states a text of {} bytes": "the size is over 4096 or the bytes left",
        "it states {} elements": "the count is over 10 000 or the bytes left",
    },
    "opening": {
        "a bag of format 1": "its first bytes, #ROSBAG V1",
        "cannot be read ({})": "what the system says",
        "it {}": "what the file is instead of a regular one",
        "not a known log format": "its first bytes are those of no format",
        "{}": "damage of a packed file, at its place",
        "{} and {} hold the same {} messages: the recording is duplicated": "count, "
        "and checksum of receipts and bytes, of both files",
        "{} logs in this folder.": "the count of names with a known ending",
    },
    "record": {
        "cannot be read ({}).": "what the system says",
        "it is not a record of an import ({}).": "the first field that is wrong",
        "it {}.": "what the file is instead of a regular one",
    },
    "robot": {
        "a name occurs twice": "fewer names than links or joints",
        "a {} has no usable name": "an empty, long or unprintable name",
        "byte {} is not {}": "the first byte that the encoding cannot say",
        "cannot be read ({})": "what the system says",
        "elements over {} deep": "the depth",
        "it holds <!DOCTYPE or <!ENTITY": "the bytes of either",
        "it holds xacro:{}": "an element in the namespace of xacro; a comment is none",
        "it is not XML ({})": "what the parser says, with line and column",
        "it {}": "what the file is instead of a regular one, or its size",
        "its element is {}, not robot": "its first element",
        "its encoding is {}, not UTF-8 or Latin-1": "the declaration",
        "joint {} has no axis": "an axis shorter than 1e-6",
        "joint {} is {}": "its type is none that one number places",
        "joint {} mimics {}": "its element mimic",
        "joint {}: no link {}": "no link has that name",
        "joint {}: {} is {}": "the text is not three finite numbers within 1 km",
        "link {} is the child of {} and {}": "the second joint with that child",
        "link {} is its own parent": "the way up from it comes back to it",
        "no joint moves between the base and {}": "every joint on the way is fixed",
        "no link {} for the {}.": "no link has that name",
        "over {} elements": "the count",
        "the links between joint {} and the foot are {} m long, the limit is {} "
        "m": "the sum of the lengths of their xyz",
        "{} links without a parent, not one: {}": "links that are no child",
        "{}, 1 to {} links can be used": "the counts of links and joints",
        "{}.": "the sentence of the caller",
    },
    "signs": {
        "In {} rows of the trials the force is over {} N while the foot moves (limit "
        "{}): the largest force is {} N, the fastest motion {} mm/s.": "the count, and "
        "both largest values",
        "These forces cannot come from the ground: {}.": "the shares of both signs",
        "Normal and traction force have the opposite sign: {}.": "F_n < 0 in 95 % and "
        "F_t along the motion in 80 % of the rows",
        "The force across the path is {} N, along it {} N.": "both medians",
    },
    "sqlite_log": {
        "a message is not bytes": "the type of its column",
        "{} shows a transaction that has not ended: its messages may be "
        "half written": "the journal is there and its first byte is not zero",
        "cannot be read as a database ({})": "what SQLite says",
        "not a rosbag2 log: the tables topics and messages are missing": "the names of "
        "its tables; a view is none",
    },
}


def test_every_refusal_states_its_observation():
    listed = {(m, text) for m, rows in ESTABLISHED_BY.items() for text in rows}
    assert {*sentences()} == listed
    assert all(seen for rows in ESTABLISHED_BY.values() for seen in rows.values())


def test_no_refusal_guesses_its_cause():
    """One of several possible causes is not stated as the cause."""
    for module, text in sentences():
        for word in ("probably", "perhaps", "likely", "maybe", "must be"):
            assert word not in text, f"{module}: {text}"
