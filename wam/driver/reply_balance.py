"""Balance of position replies and requests: detects a second sender of replies."""

from wam.driver.transmission import MOTORS

_DOUBLED = 5  # surplus replies that are an error; a repeated frame is one
_FORGIVEN_EVERY = 50  # requests, after which each balance moves one reply towards zero
_MOST_OWED = 30  # requests: as many as go unanswered before the arm is idled


class ReplyBalance:
    """Counts position replies and requests of each motor.

    A late reply is owed until it arrives. Lost and duplicate replies are forgiven at
    one per 50 requests, ten per second.

    Attributes:
        replies: replies of motors 1 to 7; incremented by the receiver.
    """

    def __init__(self) -> None:
        self.replies = [0] * MOTORS
        self._questions = 0  # each goes to all motors

    def note_question(self) -> None:
        """Count a request accepted by the bus."""
        self._questions += 1
        if self._questions % _FORGIVEN_EVERY:
            return
        for i, replies in enumerate(self.replies):
            surplus = replies - self._questions
            if surplus > 0:
                self.replies[i] -= 1
            elif surplus < 0:
                self.replies[i] = self._questions + max(surplus + 1, -_MOST_OWED)

    def doubled(self) -> int:
        """Return the motor, 1-7, with surplus replies; 0 = none."""
        largest = max(self.replies)
        if largest - self._questions < _DOUBLED:
            return 0
        return self.replies.index(largest) + 1
