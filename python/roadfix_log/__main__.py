"""What is in a log: python3 -m roadfix_log LOG [--fields CHANNEL]."""
import argparse
import sys

from . import LogError, Ragged, SchemaError, read


def _print_channels(log):
    print(f"{'channel':<24} {'type':<18} {'events':>8} {'span s':>9}")
    for name, events in log.events.channels.items():
        stamps = log.events.utime[events]
        span_s = (stamps.max() - stamps.min()) * 1e-6
        kind = log.type_name(name) or f"{log.unknown[name]:016x}"
        print(f"{name:<24} {kind:<18} {len(events):>8} {span_s:>9.2f}")


def _print_fields(channel):
    for name, values in channel.items():
        shape = f"varying x {values.values.dtype}" if isinstance(values, Ragged) else f"{values.shape} {values.dtype}"
        print(f"{name:<32} {shape}")
    for offset, reason in channel.broken:
        print(f"byte {offset}: left out: {reason}", file=sys.stderr)


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python3 -m roadfix_log", description="What is in a log.")
    parser.add_argument("log")
    parser.add_argument("--fields", metavar="CHANNEL", help="the fields of one channel with their shapes")
    parser.add_argument("--types", help="a folder of .lcm files or a recording's sidecar, asked before the package's own")
    options = parser.parse_args(arguments)
    try:
        log = read(options.log, types=options.types)
        if options.fields:
            _print_fields(log[options.fields])
        else:
            _print_channels(log)
        for damage in log.damage:
            print(f"{options.log}: byte {damage.offset}: {damage.bytes} bytes hold no intact event: {damage.what}", file=sys.stderr)
    except (OSError, LogError, SchemaError, KeyError) as error:
        print(f"roadfix_log: {error.args[0] if isinstance(error, KeyError) else error}", file=sys.stderr)
        return 2
    return 1 if log.damage else 0


if __name__ == "__main__":
    sys.exit(main())
