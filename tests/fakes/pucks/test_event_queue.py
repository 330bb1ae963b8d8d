from fakes.pucks.event_queue import NEVER, EventQueue


def schedule_of(log):
    schedule = EventQueue(0)
    schedule.define_alarm(lambda: (log.append("alarm"), schedule.set_alarm(NEVER)))
    return schedule


def test_plans_and_alarm_fire_in_time_order():
    log = []
    schedule = schedule_of(log)
    schedule.after(30, lambda: log.append("late"))
    schedule.after(10, lambda: log.append("early"))
    schedule.set_alarm(20)
    schedule.advance(40)
    assert log == ["early", "alarm", "late"]


def test_a_plan_defers_an_alarm_of_the_same_instant():
    log = []
    schedule = schedule_of(log)
    schedule.set_alarm(10)
    schedule.after(10, lambda: schedule.set_alarm(50))
    schedule.advance(40)
    assert not log
    schedule.advance(50)
    assert log == ["alarm"]


def test_the_next_event_is_the_sooner_of_plan_and_alarm():
    schedule = schedule_of([])
    assert schedule.next_ns == NEVER
    schedule.after(30, list)
    assert schedule.next_ns == 30
    schedule.set_alarm(20)
    assert schedule.next_ns == 20
    schedule.set_alarm(NEVER)
    assert schedule.next_ns == 30
    schedule.advance(30)
    assert schedule.next_ns == NEVER


def test_plans_of_one_instant_keep_their_order():
    log = []
    schedule = schedule_of(log)
    for number in range(3):
        schedule.after(5, lambda number=number: log.append(number))
    schedule.advance(5)
    assert log == [0, 1, 2]


def test_a_plan_made_for_the_present_fires_at_once():
    log = []
    schedule = schedule_of(log)
    schedule.after(5, lambda: schedule.after(0, lambda: log.append(schedule.now_ns)))
    schedule.advance(9)
    assert log == [5]
    assert schedule.now_ns == 9
