"""Position replies against questions: does something answer in a puck's name?"""

from wam.driver.transmission import MOTORS

_DOUBLED = 5  # replies more than questions; a frame that the bus repeats is one
_FORGIVEN_EVERY = 50  # questions, after which each balance is a reply nearer to zero
_MOST_OWED = 30  # questions: as many as go unanswered before the arm is idled


class ReplyBalance:
    """Counts replies and questions of each motor.

    A reply that is late is owed until it comes. Of those that are lost, and of those
    that come twice by accident, one in 50 questions is forgotten: ten a second.

    Attributes:
        replies: of motors 1 to 7; whoever hears one counts it here.
    """

    def __init__(self) -> None:
        self.replies = [0] * MOTORS
        self._questions = 0  # each asks all motors

    def note_question(self) -> None:
        """Count a question that the bus took."""
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
        """Return the motor, 1-7, that answers more often than asked; 0 = none does."""
        most = max(self.replies)
        if most - self._questions < _DOUBLED:
            return 0
        return self.replies.index(most) + 1
