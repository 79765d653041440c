// The journal's form: one line per entry, "CRC LENGTH PAYLOAD\n". PAYLOAD is one JSON object without line breaks, LENGTH its bytes in
// decimal, CRC eight hex digits of the CRC-32 over "LENGTH PAYLOAD". A line that is not whole or does not sum up is never believed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"

namespace lightstage {

std::string JournalLine(std::string_view payload);

struct JournalScan {
  // Bytes up to which every line is good. What follows without any good line after it is a torn tail: a crash during an append
  // leaves one, and it is to be cut off.
  uint64_t good_bytes = 0;
  uint64_t torn_bytes = 0;
  // Bad lines before good ones, or good lines that `entry` refused: no crash does that. DATA_LOSS / JOURNAL_CORRUPT naming `name`,
  // line and offset of the first.
  absl::Status damage;
};

// Hands the payload of every good line, in order, also behind damage, to `entry`, whose error counts as damage.
JournalScan ScanJournal(std::string_view text, std::string_view name,
                        absl::FunctionRef<absl::Status(std::string_view payload)> entry);

}  // namespace lightstage
