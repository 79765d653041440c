// Abseil's string functions for std::string_view.
//
// Debian builds Abseil for C++14, where absl::string_view is a type of its own that does not
// convert from std::string_view. Our interfaces speak std::string_view; these overloads, which
// vanish where the two are one type, let absl::StrCat and absl::StrAppend take it like any other
// string. For the rest there is AbslView().
#pragma once

#include <string>
#include <string_view>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace lightstage {

inline absl::string_view AbslView(std::string_view s) { return {s.data(), s.size()}; }

namespace strings_internal {

template <class T>
inline constexpr bool kForeignView = std::is_same_v<T, std::string_view> &&
                                     !std::is_convertible_v<std::string_view, absl::string_view>;

template <class T>
decltype(auto) ToAbsl(const T& value) {
  if constexpr (kForeignView<T>) {
    return AbslView(value);
  } else if constexpr (std::is_array_v<T>) {
    return absl::string_view(value);
  } else {
    return (value);
  }
}

}  // namespace strings_internal
}  // namespace lightstage

namespace absl {

template <class... T>
requires(lightstage::strings_internal::kForeignView<T> || ...) std::string
    StrCat(const T&... pieces) {
  return StrCat(AlphaNum(lightstage::strings_internal::ToAbsl(pieces))...);
}

template <class... T>
requires(lightstage::strings_internal::kForeignView<T> || ...) void StrAppend(std::string* out,
                                                                              const T&... pieces) {
  StrAppend(out, AlphaNum(lightstage::strings_internal::ToAbsl(pieces))...);
}

}  // namespace absl
