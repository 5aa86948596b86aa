"""Separation of a trial's own records, files and messages from those of other trials in a file."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

from selfmodel.logs.mcap.chain import batch_of
from selfmodel.logs.mcap.contents import Contents
from selfmodel.logs.mcap.framing import ContradictionError
from selfmodel.logs.mcap.provenance import identity_of, manifest, manifest_parts, seal_of
from selfmodel.logs.records import HIDDEN, MANIFEST, NONCE, RESULT, TRIAL
from selfmodel.logs.salvage.findings import Channels, Findings, Group

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Discarded:
    """Intact messages that are not proven to be of the trial, by the trial in their seals.

    Attributes:
        trial: Name of the trial in the seals; "" without a seal.
        identity: Identity of the trial in the seals, in hexadecimal; "" without a seal. The
            trial's own identity for batches that are incomplete or altered.
        batches: Number of different batches.
        steps: Number of control steps in these batches.
    """

    trial: str
    identity: str
    batches: int
    steps: int


@dataclass(frozen=True)
class Rescued:
    """Intact contents of a damaged log.

    Attributes:
        contents: Records, files and messages of one trial.
        identity: Identity of the trial, in hexadecimal; "" for a log of an earlier version, whose
            messages are not tied to their trial.
        absent: Names of the records and files in the manifest that were not found. The truth may be
            removed from a log, and is not among them.
        discarded: Intact messages that are left out.
    """

    contents: Contents
    identity: str
    absent: tuple[str, ...]
    discarded: tuple[Discarded, ...]


def own_contents(found: Findings) -> Rescued:
    """Returns the contents that belong to the first trial of a file.

    In a log of an earlier version, these are the first record and file of each name, and all
    messages without a seal.

    Raises:
        ContradictionError: There are two different messages of one time, or batches of two runs of
            the trial.
    """
    channels = Channels(found)
    groups = list(channels.groups(found.messages))
    digest, trial = next(iter(found.records.get(TRIAL, {}).items()), ("", {}))
    if NONCE in trial:
        listed = _manifest(found, digest)
        identity = identity_of(listed)
        contents = _listed(found, listed)
        absent = _absent(listed, contents)
        own = _consistent(groups, identity, channels)
    else:
        identity, absent = b"", ()
        contents = Contents("ros2", _firsts(found.records), _firsts(found.files))
        own = [group for group in groups if group.seal is None]
    contents.topics = channels.by_topic(chain.from_iterable(group.messages for group in own))
    digests = {group.seal.digest for group in own if group.seal}
    others = [
        group
        for group in groups
        if (group.seal.digest not in digests if group.seal else bool(identity))
    ]
    return Rescued(contents, identity.hex(), absent, _discarded(others, channels))


def _firsts(items: Mapping[str, Mapping[str, _Item]]) -> dict[str, _Item]:
    return {name: next(iter(same.values())) for name, same in items.items()}


def _manifest(found: Findings, trial: str) -> Mapping[str, str]:
    """Manifest of the trial whose record has this digest; if lost, made anew of what is left."""
    for texts in found.records.get(MANIFEST, {}).values():
        if manifest_parts(texts)[0].get(TRIAL) == trial:
            return texts
    records = {
        name: next(iter(same))
        for name, same in found.records.items()
        if name not in (MANIFEST, RESULT)
    }
    return manifest(records, {name: next(iter(same)) for name, same in found.files.items()})


def _listed(found: Findings, listed: Mapping[str, str]) -> Contents:
    """Contents with the records and files of a manifest, as far as they were found."""
    records, files = manifest_parts(listed)
    return Contents(
        "ros2",
        {
            name: found.records[name][digest]
            for name, digest in records.items()
            if digest in found.records.get(name, {})
        },
        {
            name: found.files[name][digest]
            for name, digest in files.items()
            if digest in found.files.get(name, {})
        },
    )


def _absent(listed: Mapping[str, str], contents: Contents) -> tuple[str, ...]:
    records, files = manifest_parts(listed)
    return (
        *sorted(records.keys() - contents.metadata.keys() - {HIDDEN}),
        *sorted(files.keys() - contents.attachments.keys()),
    )


def _consistent(groups: Iterable[Group], identity: bytes, channels: Channels) -> list[Group]:
    """Batches that are sealed for the trial, in order and without duplicates.

    Raises:
        ContradictionError: Two batches are of different runs of the trial.
    """
    own: dict[int, Group] = {}
    last: dict[int, bytes] = {-1: identity}
    for group in groups:
        if group.seal and group.seal.identity == identity and _is_sealed(group, channels):
            index = group.seal.index
            own.setdefault(index, group)
            if last.setdefault(index, group.seal.digest) != group.seal.digest:
                raise ContradictionError(f"it has two different batches {index} of the trial")
    for index, group in own.items():
        if group.seal and last.get(index - 1, group.seal.previous) != group.seal.previous:
            raise ContradictionError(f"its batches {index - 1} and {index} are of different runs")
    return [own[index] for index in sorted(own)]


def _is_sealed(group: Group, channels: Channels) -> bool:
    seal = group.seal
    if seal is None or any(message.channel_id not in channels.keys for message in group.messages):
        return False
    batch = batch_of(group.messages, channels.keys)
    return seal == seal_of(seal.trial, seal.identity, seal.index, seal.previous, batch)


def _discarded(groups: Sequence[Group], channels: Channels) -> tuple[Discarded, ...]:
    digests: defaultdict[tuple[str, str], set[bytes]] = defaultdict(set)
    times: defaultdict[tuple[str, str], set[int]] = defaultdict(set)
    for group in groups:
        seal = group.seal
        trial = (seal.trial, seal.identity.hex()) if seal else ("", "")
        digests[trial].add(seal.digest if seal else b"")
        times[trial].update(
            message.log_time
            for message in group.messages
            if channels.topics.get(message.channel_id) == _EVERY_STEP
        )
    return tuple(
        Discarded(*trial, batches=len(digests[trial]) if trial[1] else 0, steps=len(times[trial]))
        for trial in digests
    )


_EVERY_STEP = "/joint_states"
