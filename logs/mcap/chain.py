"""Verification of a log's provenance: preamble, batches and result are of one trial."""

from collections.abc import Mapping, Sequence

from mcap.records import Message

from selfmodel.logs.mcap.framing import ContradictionError
from selfmodel.logs.mcap.provenance import (
    Batch,
    Seal,
    identity_of,
    manifest_parts,
    parse_seal,
    seal_of,
)
from selfmodel.logs.records import (
    HIDDEN,
    LAST_BATCH,
    MANIFEST,
    NONCE,
    RESULT,
    TRIAL,
    sha256,
)

_UNTIED = (MANIFEST, RESULT)
"""Records outside the manifest: the manifest itself, and the result, which has its own tie."""


def batch_of(messages: Sequence[Message], keys: Mapping[int, bytes]) -> Batch:
    """Returns messages as a batch.

    Args:
        messages: Messages in the order of the file.
        keys: ``topic_key`` by channel.
    """
    return Batch(
        [keys[message.channel_id] for message in messages],
        [message.log_time for message in messages],
        [message.publish_time for message in messages],
        [message.data for message in messages],
    )


class Chain:
    """Check of the seals of a file, in one pass.

    Attributes:
        keys: ``topic_key`` by channel; the caller adds the channels.
        seals: Channel of the seals, if known; set by the caller.
    """

    def __init__(self) -> None:
        self.keys: dict[int, bytes] = {}
        self.seals = -1
        self._pending: list[Message] = []
        self._last: Seal | None = None

    def add(self, message: Message) -> None:
        """Adds a message; a seal is compared with the messages before it.

        Raises:
            ContradictionError: The messages are not those that were sealed, or the batch does not
                follow the previous batch.
        """
        if message.channel_id != self.seals:
            self._pending.append(message)
            return
        seal, last = parse_seal(message.data, message.log_time), self._last
        identity, index, previous = (
            (last.identity, last.index + 1, last.digest)
            if last
            else (seal.identity, 0, seal.identity)
        )
        if seal.identity != identity:
            raise ContradictionError(f"batch {index} of its messages is of another trial")
        if (seal.index, seal.previous) != (index, previous):
            raise ContradictionError(f"batch {index} of its messages is missing or misplaced")
        if seal != seal_of(
            seal.trial, identity, index, previous, batch_of(self._pending, self.keys)
        ):
            raise ContradictionError(f"the digest of batch {index} of its messages is wrong")
        self._last = seal
        self._pending.clear()

    def digest(
        self,
        metadata: Mapping[str, Mapping[str, str]],
        digests: Mapping[str, str],
        attachments: Mapping[str, bytes],
    ) -> str:
        """Returns the digest of the log at its end; "" in a log of an earlier version.

        Args:
            metadata: Metadata records by name.
            digests: Digests of the records of selfmodel by name.
            attachments: Attached files by name.

        Raises:
            ContradictionError: Preamble, messages and result are not of one trial.
        """
        trial = metadata.get(TRIAL)
        if trial is None:
            return ""
        if NONCE not in trial:
            if self._last or MANIFEST in metadata:
                raise ContradictionError("its messages are of another trial than its records")
            return ""
        self._check_preamble(metadata, digests, attachments)
        if RESULT not in metadata:
            return ""
        last = self._last.digest.hex() if self._last else ""
        if self._pending or metadata[RESULT].get(LAST_BATCH) != last:
            raise ContradictionError("its last messages are missing, or of another trial")
        return digests[RESULT]

    def _check_preamble(
        self,
        metadata: Mapping[str, Mapping[str, str]],
        digests: Mapping[str, str],
        attachments: Mapping[str, bytes],
    ) -> None:
        if MANIFEST not in metadata:
            raise ContradictionError(f"it has no record {MANIFEST}")
        if self._last and self._last.identity != identity_of(metadata[MANIFEST]):
            raise ContradictionError("its messages are of another trial than its records")
        records, files = manifest_parts(metadata[MANIFEST])
        # The truth may be removed, so that a log can be given away for a blind diagnosis.
        for name in {*records, *digests} - {*_UNTIED, HIDDEN}:
            if digests.get(name) != records.get(name):
                raise ContradictionError(f"the record {name} is not that of the trial")
        if HIDDEN in digests and digests[HIDDEN] != records.get(HIDDEN):
            raise ContradictionError(f"the record {HIDDEN} is not that of the trial")
        for name in {*files, *attachments}:
            if name not in attachments or sha256(attachments[name]) != files.get(name):
                raise ContradictionError(f"the file {name} is not that of the trial")
