"""The plant's energy, its effects, and the mains stage."""

import itertools

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.lab.cell import build_cell
from acqd.lab.effects import known_effects, make_effects, parse_effect
from acqd.lab.instruments.data_recorder import ControllerClock
from acqd.lab.instruments.mains import Mains, MainsSettings, Metered
from acqd.lab.motion.controller import Controller, Move, Phase, SwitchTool, Wait
from acqd.lab.plant import Plant, Stretch
from acqd.lab.plant.electrics import DcStorage
from acqd.lab.plant.parameters import DcLink, load_plant
from acqd.lab.settings import LabSettings
from acqd.metering import Meter, SampleBlock, WindowBatch
from acqd.robot import load_description, shipped_descriptions
from acqd.robot.dynamics import mechanical_energy
from acqd.robot.kinematics import forward_kinematics

IIWA = load_description("iiwa7_r800")

CELL = build_cell(LabSettings())


def motion_of(cell, seed=0, moves=6, tool=True):
    random = np.random.default_rng(seed)
    robot = cell.robot
    targets = random.uniform(np.maximum(robot.lower, -2), np.minimum(robot.upper, 2), (moves, robot.axes)) * 0.6
    program = [Wait(1.0)]
    for number, target in enumerate(targets):
        program.append(Move(target, float(random.uniform(0.2, 0.5)), 0.2, 0.8))
        if tool and number == 2:
            program += [SwitchTool(True), Wait(0.3)]
    program += [SwitchTool(False), Wait(12.0)]
    return Controller(robot, np.zeros(robot.axes)).run(program)


MOTION = motion_of(CELL)
VOLTAGE = 230 + 2 * np.sin(np.arange(len(MOTION)) * 2e-4)


def run(effects=(), motion=MOTION, cell=CELL, pieces=1):
    plant = Plant(cell.true_arm, cell.parameters, effects)
    edges = np.linspace(0, len(motion), pieces + 1).astype(int)
    power = [plant.run(motion.part(a, b), VOLTAGE[a:b], Stretch(a / 1000)).power for a, b in itertools.pairwise(edges)]
    return plant, np.concatenate(power)


CLEAN = run()[1]


@pytest.mark.parametrize("name", shipped_descriptions())
def test_energy_balances_for_every_robot(name):
    cell = build_cell(LabSettings(robot=name))
    motion = motion_of(cell)
    plant = Plant(cell.true_arm, cell.parameters)
    plant.run(motion, np.full(len(motion), 230.0))
    balance = plant.ledger.balance()
    assert balance["unaccounted_share"] < 1e-6
    assert all(energy > 0 for name, energy in balance["dissipated_J"].items() if name != "chopper")


@pytest.mark.parametrize("name", list(known_effects()))
def test_energy_balances_with_every_effect(name):
    plant, _ = run(make_effects([parse_effect(name)], [1]), pieces=3)
    assert plant.ledger.balance()["unaccounted_share"] < 1e-6


def test_the_ledger_notices_what_is_missing():
    """The balance closes because the physics does, not because the ledger makes it."""
    plant = Plant(CELL.true_arm, CELL.parameters)
    rotor = plant._body.rotor_torque
    plant._body.rotor_torque = lambda motion: 1.02 * rotor(motion)  # torque without the inertia to explain it
    fastest = int(np.abs(MOTION.qd).max(axis=1).argmax())
    plant.run(MOTION.part(0, fastest), VOLTAGE[:fastest])
    assert plant.ledger.balance()["unaccounted_share"] > 1e-5


def test_pieces_make_the_same_power_as_the_whole():
    assert np.abs(run(pieces=5)[1] - CLEAN).max() < 5e-3  # gears warm up in steps of a second from each begin


def test_standby_is_that_of_the_thesis_and_motion_takes_more():
    closed = ~MOTION.brake_open
    assert CLEAN[closed][:900].mean() == pytest.approx(155, abs=2)
    assert CLEAN[MOTION.brake_open].mean() > 165


MECHANICAL = {
    "coulomb_friction", "viscous_friction", "stribeck_friction", "load_dependent_friction", "thermal_friction",
    "mechanical_power", "copper_loss", "supply_efficiency",
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(MECHANICAL))
def test_losses_never_give_power(name):
    power = run(make_effects([parse_effect(name)], [1]))[1]
    moving = np.abs(MOTION.qd).max(axis=1) > 0.05
    assert (power - CLEAN).mean() > 0.05
    assert (power - CLEAN)[moving].mean() > (power - CLEAN)[~moving].mean()


@pytest.mark.parametrize("name", sorted(set(known_effects()) - {"meter_gain", "meter_saturation"}))
def test_an_effect_does_nothing_before_its_onset_and_scales_with_its_strength(name):
    strength = known_effects()[name].strength[0]
    later = make_effects([parse_effect(f"{name}:from=2")], [1])
    assert np.array_equal(run(later)[1], CLEAN)
    default = known_effects()[name].defaults[strength]
    weak = run(make_effects([parse_effect(f"{name}:{strength}={default / 4}")], [1]))[1] - CLEAN
    strong = run(make_effects([parse_effect(name)], [1]))[1] - CLEAN
    if np.abs(strong).max() > 1e-6:
        assert np.abs(strong).sum() > 2 * np.abs(weak).sum() > 0


def test_an_effect_at_two_hooks_keeps_the_balance():
    class Both(known_effects()["offset_shift"]):
        def dc_load(self, situation):
            return 5.0 * self.gate(situation)

        def torque(self, situation):
            return 0.5 * np.tanh(situation.motion.qd / 0.01)

    plant, power = run([Both({}, (1, 0.0), np.random.default_rng(0))])
    assert plant.ledger.balance()["unaccounted_share"] < 1e-6
    assert (power - CLEAN)[500] > 12


def test_an_onset_within_a_recording_is_kept_to_the_millisecond():
    power = run(make_effects([parse_effect("offset_shift:at=3.0")], [1]))[1]
    changed = np.flatnonzero(np.abs(power - CLEAN) > 1e-9)
    assert changed[0] == 3000


def test_brakes_peak_when_they_open():
    power = run(make_effects([parse_effect("brake_release")], [1]), pieces=4)[1] - CLEAN
    opening = np.flatnonzero(np.diff(MOTION.brake_open.astype(int)) == 1)[0]
    assert opening < power.argmax() < opening + 100
    assert power.max() > 150
    assert np.abs(power[: opening - 1]).max() < 1e-9


def test_a_payload_carried_by_the_tool_acts_only_while_it_is_on():
    power = run(make_effects([parse_effect("payload:with_tool=1,mass_kg=3")], [1]))[1]
    on = np.flatnonzero(MOTION.tool_on)
    assert np.abs((power - CLEAN)[: on[0]]).max() < 1e-9
    assert np.abs((power - CLEAN)[on[0] : on[-1]]).max() > 1.0


def test_the_log_of_a_biased_sensor_is_biased():
    plant = Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect("torque_bias:axis=4,torque_Nm=2")], [1]))
    honest = Plant(CELL.true_arm, CELL.parameters)
    part, voltage = MOTION.part(0, 2000), VOLTAGE[:2000]
    difference = plant.run(part, voltage).recorded.tau - honest.run(part, voltage).recorded.tau
    np.testing.assert_allclose(difference, np.tile([0, 0, 0, 2.0, 0, 0, 0], (2000, 1)), atol=1e-12)


def test_clock_effects_change_the_clock_from_their_recording_on():
    offset, drift = make_effects([parse_effect("clock_offset:from=3"), parse_effect("clock_drift:from=3")], [1])
    clock = ControllerClock()
    begins = {1: 0.0, 2: 0.0, 3: 5000.0, 4: 5000.0}.__getitem__  # two recordings a session
    assert offset.clock(clock, 2, begins) == drift.clock(clock, 2, begins) == clock
    assert offset.clock(clock, 3, begins).offset_s == 0.2
    faster = drift.clock(clock, 4, begins)
    at = np.array([5000.0, 6000.0])
    np.testing.assert_allclose(faster.reading(at) - at, [0.0, 0.03], atol=1e-9)  # a bend, no jump


def power_of(order, motion=MOTION, voltage=VOLTAGE, stretch=None):
    plant = Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect(order)], [1]))
    clean = Plant(CELL.true_arm, CELL.parameters)
    return plant.run(motion, voltage, stretch).power - clean.run(motion, voltage, stretch).power


def test_pressing_downwards_helps_when_going_up_and_costs_when_going_down():
    """The table pushes the flange up: rising needs less power than without, sinking more."""
    targets = np.radians([[0, 60, 0, -60, 0, 30, 0], [0, 20, 0, -60, 0, 30, 0], [0, 70, 0, -60, 0, 30, 0]])
    motion = Controller(IIWA, np.zeros(7)).run([Phase("contact"), *(Move(target, 0.4, 0.2) for target in targets)])
    rising = np.gradient(forward_kinematics(CELL.arm, motion.q)[0][:, 2], 1e-3)
    pressed = power_of("contact_force:force_N=60", motion, np.full(len(motion), 230.0))
    active = (np.abs(pressed) > 1) & (np.abs(rising) > 0.05)
    assert active.sum() > 100
    assert np.corrcoef(pressed[active], rising[active])[0, 1] < -0.5


def test_a_heavier_link_costs_power_on_the_way_up_and_a_lighter_one_saves_it():
    potential = np.gradient(mechanical_energy(CELL.arm, MOTION.q, 0 * MOTION.q), 1e-3)
    fast = np.abs(potential) > 5
    for order, sign in (("gravity_bias:mass_kg=3", 1), ("gravity_bias:mass_kg=-3", -1)):
        assert sign * np.corrcoef(power_of(order)[fast], potential[fast])[0, 1] > 0.4


def test_higher_voltage_means_more_power_in_proportion():
    volts = np.full(len(MOTION), 230 * 1.02)
    np.testing.assert_allclose(
        power_of("line_voltage:exponent=1", voltage=volts)[1000:] / CLEAN[1000:], 0.02, rtol=0.02
    )
    assert np.abs(power_of("line_voltage:exponent=1", voltage=np.full(len(MOTION), 230.0))).max() < 1e-9


def test_only_power_given_back_is_burnt():
    plant = Plant(CELL.true_arm, CELL.parameters)
    trace = plant.run(MOTION, VOLTAGE)
    given = np.maximum(-trace.situation.joint_power.sum(axis=1), 0)
    extra = power_of("regeneration_clipping")
    assert given.max() > 5
    assert extra.sum() == pytest.approx(given.sum(), rel=0.12)  # and the supply's losses on it
    assert (extra[given.cumsum() == 0] == 0).all()


def test_a_thermostat_is_on_for_its_share_of_its_period():
    motion = Controller(IIWA, np.zeros(7)).run([Wait(3000.0)])
    extra = power_of("thermostat:power_W=10,period_s=60,duty=0.3", motion, np.full(len(motion), 230.0))
    assert extra.mean() == pytest.approx(3.0, rel=0.1)
    assert np.diff(extra > 5).sum() == pytest.approx(100, abs=8)


def test_equipment_works_in_bursts_and_in_its_phases():
    motion = Controller(IIWA, np.zeros(7)).run([Wait(300.0)])
    extra = power_of("process_load:power_W=20", motion, np.full(len(motion), 230.0))
    assert 0.1 < (extra > 15).mean() < 0.6
    motion = Controller(IIWA, np.zeros(7)).run([Wait(2.0), Phase("screw"), Wait(3.0), Phase("rest"), Wait(2.0)])
    extra = power_of("process_load:power_W=20", motion, np.full(len(motion), 230.0))
    np.testing.assert_allclose(extra[[1900, 2500, 4900, 5500]], [0, 20, 20, 0], atol=0.1)


@pytest.mark.parametrize("name", ["tool_actuation", "process_load", "contact_force", "thermostat", "brake_release"])
def test_effects_with_a_state_do_not_care_how_motion_is_cut(name):
    whole, pieces = (run(make_effects([parse_effect(name)], [1]), pieces=count)[1] for count in (1, 37))
    assert np.abs(whole - pieces).max() < 0.05


def test_cold_gears_are_cold_when_the_effect_begins():
    later = power_of("thermal_friction:from=2,minutes=0.2", stretch=Stretch(0.0, 2))
    at_once = power_of("thermal_friction:minutes=0.2")
    np.testing.assert_allclose(later, at_once, atol=1e-9)


def test_an_effect_goes_on_after_the_last_recording(tmp_path):
    from acqd.lab.session import Session

    settings = LabSettings(effects=[parse_effect("offset_shift:power_W=50,at=1.0")])
    cell = build_cell(settings)
    session = Session(cell, 0, settings.start_utc_ns, np.zeros(7), lambda batch: None)
    session.record([Wait(3.0)], 1, "still", tmp_path / "still.log")
    truth = session.finish()
    hidden = truth.power - truth.clean_power
    np.testing.assert_allclose(hidden[[5, 20, 40, 80, 120]], [0, 0, 50, 50, 50], atol=0.1)


def test_a_saturation_begins_within_a_recording(tmp_path):
    from acqd.lab.session import Session

    settings = LabSettings(effects=[parse_effect("meter_saturation:limit_A=0.5,at=2.0")])
    cell = build_cell(settings)
    session = Session(cell, 0, settings.start_utc_ns, np.zeros(7), lambda batch: None)
    session.record([Wait(4.0)], 1, "still", tmp_path / "still.log")
    truth = session.finish()
    error = truth.metered - truth.power
    assert np.abs(error[:48]).max() < 1 and error[55:95].max() < -20


def test_what_comes_back_is_stored_up_to_the_limit_and_then_burnt():
    storage = DcStorage(DcLink(electronics_W=0, capacitor_J=5.0))
    net = np.concatenate([np.full(100, 20.0), np.full(300, -50.0), np.full(300, 30.0)])
    drawn, burnt, stored = storage.run(net)
    np.testing.assert_allclose(drawn, net + burnt + stored, atol=1e-12)
    assert (drawn >= -1e-9).all()
    assert burnt.sum() / 1000 == pytest.approx(0.3 * 50 - 5.0, abs=0.06)
    assert storage.energy == 0.0
    assert drawn[400:560].max() == pytest.approx(0.0, abs=1e-9)  # the capacitor feeds the drives first


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("paylod", "effect 'paylod' is unknown; did you mean payload"),
        ("xyzzy", "effect 'xyzzy' is unknown; known: brake_holding"),
        ("payload:mass=1", "effect payload: 'mass' is not one of mass_kg=, with_tool=, from=, at="),
        ("payload:mass_kg=heavy", "'mass_kg=heavy' is not like name=1.5"),
        ("payload:mass_kg", r"'mass_kg' is not like name=1.5 .no =."),
        ("payload:mass_kg=-2", r"mass_kg=-2 is outside 0.001 .. 1000"),
        ("thermostat:period_s=0", r"period_s=0 is outside 1 .. 100000"),
        ("clock_drift:at=3", "it can only start with a recording"),
        ("payload:mass_kg=nan", "is not a finite number"),
        ("payload:from=0", "expected a recording number from 1"),
    ],
)
def test_a_wrong_effect_is_named(text, complaint):
    with pytest.raises(UserError, match=complaint):
        parse_effect(text)


def test_a_plant_file_for_another_number_of_axes_is_refused():
    from acqd.lab.plant import parameters

    path = parameters._FOLDER / "ur3e.toml"
    with pytest.raises(InputError, match=r"friction\.coulomb_Nm has 6 values, but iiwa7_r800 has 7 axes"):
        load_plant(load_description("iiwa7_r800"), path)


def metered(settings, power, fault=None, window=0.04, chunk=3000):
    mains = Mains(settings, np.random.default_rng(5))
    meter = Meter(mains.form, window=window)
    batches, index = [], 0
    for first in range(0, len(power), chunk):
        part = power[first : first + chunk]
        ones = np.ones(len(part))
        codes = mains.waveform(part, fault and Metered(fault.gain[0] * ones, fault.limit[0] * ones))
        batches.append(meter.feed(SampleBlock(codes, index, index * 50_000)))
        index += len(codes)
    return WindowBatch.join([batch for batch in batches if batch is not None])


@pytest.mark.parametrize(
    "settings",
    [
        MainsSettings(),
        MainsSettings(shape="rectifier"),
        MainsSettings(frequency=60.0, voltage=120.0),
        MainsSettings(harmonics={}, current_harmonics={}, frequency_wander=0, voltage_wander=0, filter_current=0),
        MainsSettings(voltage_wander=5.0, frequency_wander=0.1, filter_current=0.4),
    ],
)
@pytest.mark.parametrize("power", [40.0, 155.0, 600.0])
def test_the_meter_reads_the_power_that_was_demanded(settings, power):
    window = 0.05 if settings.frequency > 55 else 0.04
    batch = metered(settings, np.full(20_000, power), window=window)
    np.testing.assert_allclose(batch.P[0], power, rtol=1e-3)
    assert abs(batch.P[0].mean() / power - 1) < 2e-4
    assert abs(batch.f.mean() - settings.frequency) < 0.5
    assert abs(batch.Vrms[0].mean() / settings.voltage - 1) < 0.1


def test_changing_power_is_metered_without_losing_energy():
    t = np.arange(30_000) / 1000
    power = 180 + 60 * np.sin(2 * np.pi * 1.3 * t) + 40 * (t % 2 > 1)
    batch = metered(MainsSettings(), power)
    assert batch.W[0][-1] * 3.6e6 == pytest.approx(np.trapezoid(power[: len(batch) * 40 + 1], dx=1e-3), rel=1e-4)


def test_waveforms_do_not_depend_on_how_they_are_asked_for():
    power = 180 + 50 * np.sin(np.arange(9000) / 300)
    whole, parts = (Mains(MainsSettings(noise_A=0, noise_V=0), np.random.default_rng(1)) for _ in range(2))
    pieces = np.concatenate([parts.waveform(power[a:b]) for a, b in ((0, 1), (1, 4000), (4000, 4001), (4001, 9000))])
    difference = whole.waveform(power).astype(int) - pieces
    assert np.abs(difference).max() <= 1


def test_a_rectifier_draws_pulses_and_a_pfc_a_sine():
    pulses = metered(MainsSettings(shape="rectifier", filter_current=0), np.full(5000, 200.0))
    sine = metered(MainsSettings(filter_current=0), np.full(5000, 200.0))
    power_factor = [float((batch.P / batch.S).mean()) for batch in (pulses, sine)]
    assert power_factor[0] < 0.85 < 0.99 < power_factor[1]


def test_inrush_drives_the_converter_over_its_range_once():
    batch = metered(MainsSettings(inrush=20.0), np.full(5000, 155.0))
    flagged = [k for k, flags in enumerate(batch.flags[0]) if "overrange" in flags]
    assert flagged and max(flagged) < 5


def test_a_faulty_current_sensor_shows_in_the_power():
    power = np.full(5000, 200.0)
    gain = metered(MainsSettings(), power, Metered(np.array([1.03]), np.array([np.inf])))
    assert gain.P[0].mean() == pytest.approx(206.0, rel=1e-3)
    clipped = metered(MainsSettings(), power, Metered(np.array([1.0]), np.array([1.0])))
    assert clipped.P[0].mean() < 190
