"""Two examples of every command, as its help shows them."""

from __future__ import annotations

_SIMULATED = ("hand", "sphere", "belt", "circle", "flight", "boat", "car", "static", "tumble")

EXAMPLES: dict[str, tuple[str, str]] = {
    "agonic": (
        "agonic demo",
        "agonic calibrate flight.bin",
    ),
    "agonic calibrate": (
        "agonic calibrate flight.bin",
        "agonic calibrate bench.csv --unit uT --at 52.1,5.2,10 --date 2026-05-01",
    ),
    "agonic live": (
        "agonic live /dev/ttyUSB0 --unit uT --at 52.1,5.2",
        "agonic live sim --text --speed 0",
    ),
    "agonic fit": (
        "agonic fit ellipsoid bench.csv --field 48000 -o mag.json",
        "agonic fit inflight pass.csv --ground mag.json -o now.json",
    ),
    "agonic verify": (
        "agonic verify mag.json later.csv --field 48000",
        "agonic verify mag.json flight.bin --sensor MAG2",
    ),
    "agonic evaluate": (
        "agonic evaluate flight.bin --report flight.html",
        "agonic evaluate walk.csv --truth optical.csv --json",
    ),
    "agonic demo": (
        "agonic demo",
        "agonic demo -o here --seed 3",
    ),
    "agonic heading": (
        "agonic heading setup.toml flight.bin -o headings.csv",
        'agonic heading mag.json walk.csv --at 52.1,5.2 --mounting "x up, y forward" -o out.csv',
    ),
    "agonic field": (
        "agonic field --at 47.4,8.5,450 --date 2026-03-01",
        "agonic field --points sites.csv -o field.csv",
    ),
    "agonic direction": (
        "agonic direction cal.json night -o field.csv",
        "agonic direction cal.json orbit.csv --stars star.csv --across 3 --about 20 -o field.csv",
    ),
    "agonic track": (
        "agonic track pass1.csv --state state.json --ground mag.json",
        "agonic track pass2.csv --state state.json --report pass2.html",
    ),
    "agonic retrain": (
        "agonic retrain pass.csv --ground net.json --window 2h --every 30m --state net.state.json",
        "agonic retrain flight.csv --reference known.csv --ground net.json -o now.json",
    ),
    "agonic plan": (
        "agonic plan swing --headings 16 -o swing.html",
        "agonic plan thermal --sensors 2xMMC5883MA --range -10,50 -o plan.html",
    ),
    "agonic simulate": (
        "agonic simulate tumble -o log.csv",
        "agonic simulate vehicle -o flight.csv -n 6000",
    ),
    "agonic fleet": (
        "agonic fleet logs -o may --field 48000 --reports",
        "agonic fleet logs/*.bin -o may --workers 8 --fail-above 0.05",
    ),
    "agonic history": (
        "agonic history --store boards.sqlite",
        "agonic history SN0042 --store boards.sqlite -o SN0042.html",
    ),
    "agonic info": (
        "agonic info flight.bin",
        "agonic info bench.csv --unit uT --json",
    ),
    "agonic apply": (
        "agonic apply mag.json walk.csv -o corrected.csv",
        "agonic apply mag.json flight.bin --sensor MAG2 -o corrected.parquet",
    ),
    "agonic export": (
        "agonic export mag.json --to ardupilot",
        "agonic export setup.toml --to c -o firmware --at 52.1,5.2",
    ),
    "agonic report": (
        "agonic report mag.json",
        "agonic report mag.json later.csv --field 48000 -o later.html",
    ),
    "agonic cite": (
        "agonic cite mag.json",
        "agonic cite mag.json --json",
    ),
    "agonic fit ellipsoid": (
        "agonic fit ellipsoid bench.csv --field 48000 -o mag.json",
        "agonic fit ellipsoid cloud.txt --model sphere --between 10,60",
    ),
    "agonic fit levelled": (
        "agonic fit levelled boat.csv --at 52.1,5.2 -o mag.json",
        "agonic fit levelled flight.bin --with current_A -o mag.json",
    ),
    "agonic fit vector": (
        "agonic fit vector survey.csv --at 52.1,5.2 -o mag.json",
        "agonic fit vector survey.csv --gauge free --sensor MAG2",
    ),
    "agonic fit inertial": (
        "agonic fit inertial ship.csv --at 52.1,5.2 -o mag.json",
        "agonic fit inertial ship.csv --sensor MAG2 --between 60,600",
    ),
    "agonic fit interference": (
        "agonic fit interference flight.bin --with current_A,throttle -o mag.json",
        "agonic fit interference flight.bin --sensor MAG --second MAG2 -o mag.json",
    ),
    "agonic fit deviation": (
        "agonic fit deviation swing.csv -o card.json --card card.html",
        "agonic fit deviation swing.csv --terms A,B,C,D,E --declination 1.5",
    ),
    "agonic fit inflight": (
        "agonic fit inflight pass.csv --ground mag.json -o now.json",
        "agonic fit inflight day1.csv day2.csv --solve full --knots auto",
    ),
    "agonic fit latency": (
        "agonic fit latency flight.bin",
        "agonic fit latency flight.bin --sensor MAG2 --method gyro",
    ),
    "agonic fit network": (
        "agonic fit network flight.csv --reference known.csv -o net.json",
        "agonic fit network flight.csv --field 48000 --hidden 6 --compare --report net.html",
    ),
    "agonic fit thermal": (
        "agonic fit thermal campaign.toml -o results",
        "agonic fit thermal recorded --degree 3 --held-out -o results",
    ),
    "agonic fit alignment": (
        "agonic fit alignment session -o alignment.json --report session.html",
        "agonic fit alignment session --wanted 5",
    ),
    "agonic fit north": (
        "agonic fit north session -o north.json --report north.html",
        "agonic fit north sheet.txt",
    ),
    "agonic fit coil": (
        "agonic fit coil session",
        "agonic fit coil session --report coil.html",
    ),
    "agonic fit remanence": (
        "agonic fit remanence turned.csv",
        "agonic fit remanence turned.csv --reference variometer.csv --report remanence.html",
    ),
    "agonic fit pair": (
        "agonic fit pair shots.csv --at 52.1,5.2 -o setup.toml --report shots.html",
        "agonic fit pair eight.csv --check setup.toml",
    ),
    "agonic fit gravity": (
        "agonic fit gravity turned.csv --calibration mag.json -o mounting.json",
        "agonic fit gravity turned.csv --bias",
    ),
    "agonic plan calibration": (
        "agonic plan calibration --wanted 0.5",
        "agonic plan calibration --tilt 20 --attitude-sd 1 -o turns.csv",
    ),
    "agonic plan disturbers": (
        "agonic plan disturbers --motors 4 --with heater_A",
        "agonic plan disturbers flight.bin --sensor MAG2",
    ),
    "agonic plan swing": (
        "agonic plan swing --headings 16 -o swing.html",
        "agonic plan swing --noise-deg 0.5 --rounds 2",
    ),
    "agonic plan placement": (
        "agonic plan placement strapped.csv",
        "agonic plan placement places.csv --noise 100",
    ),
    "agonic plan thermal": (
        "agonic plan thermal --sensors 2xMMC5883MA,3xMPU-9255 --range -10,50 -o plan.html",
        "agonic plan thermal --sensors 4xRM3100 --degree 2 --folder chamber",
    ),
    "agonic plan alignment": (
        "agonic plan alignment --at 47.4,8.5 --wanted 10 -o plan.html",
        "agonic plan alignment --at 47.4,8.5 --readings 500 --noise 5",
    ),
    **{
        f"agonic simulate {kind}": (
            f"agonic simulate {kind} -o {kind}.csv",
            f"agonic simulate {kind} -o {kind}.csv -n 2000 --noise 200 --seed 3",
        )
        for kind in _SIMULATED
    },
    "agonic simulate vehicle": (
        "agonic simulate vehicle -o flight.csv -n 6000",
        "agonic simulate vehicle -o flight.csv --bank 27 --latency 40",
    ),
    "agonic simulate shots": (
        "agonic simulate shots -o shots.csv",
        "agonic simulate shots -o later.csv --targets 0 --survey 1",
    ),
    "agonic simulate rover": (
        "agonic simulate rover -o rover.csv",
        "agonic simulate rover -o rover.csv --tilt 3 --vibration 1",
    ),
    "agonic simulate orbit": (
        "agonic simulate orbit -o day.csv",
        "agonic simulate orbit -o day.csv -n 20000 --moved 1500 --jump 3000",
    ),
    "agonic simulate network": (
        "agonic simulate network -o paper",
        "agonic simulate network --seed 3 --json -o paper",
    ),
    "agonic simulate paper": (
        "agonic simulate paper -o flight.csv",
        "agonic simulate paper -n 4500 --seed 3 -o flight.csv",
    ),
    "agonic simulate paper-space": (
        "agonic simulate paper-space -o flight.csv",
        "agonic simulate paper-space -n 4500 --seed 3 -o flight.csv",
    ),
    "agonic simulate nonaffine": (
        "agonic simulate nonaffine -o flight.csv",
        "agonic simulate nonaffine --noise 50 -o flight.csv",
    ),
    "agonic simulate campaign": (
        "agonic simulate campaign -o recorded",
        "agonic simulate campaign -o recorded --rate 0.1 --fault swapped=4,9 --fault missing=11",
    ),
    "agonic simulate fleet": (
        "agonic simulate fleet -o lab --sensors 200",
        "agonic simulate fleet -o lab --broken 0.1 --damaged 0.03 --format parquet",
    ),
    "agonic simulate alignment": (
        "agonic simulate alignment -o session",
        "agonic simulate alignment -o session --orientations 24 --seed 3",
    ),
    "agonic simulate north": (
        "agonic simulate north -o session",
        "agonic simulate north -o session --noise 0.5",
    ),
    "agonic simulate coil": (
        "agonic simulate coil -o session",
        "agonic simulate coil -o session --noise 0.5",
    ),
}
"""By the words that call a command: examples that are copied as they stand."""
