// Text for messages: proto3 strings are UTF-8, and one that is not makes a whole message unreadable for its receiver.
#pragma once

#include <string>
#include <string_view>

namespace lightstage {

// At most `bytes` of `text`, cut between characters.
std::string CutUtf8(std::string_view text, size_t bytes);

// `text` with U+FFFD for every byte that is no UTF-8: messages may quote a device or a path.
std::string CleanUtf8(std::string_view text);

}  // namespace lightstage
