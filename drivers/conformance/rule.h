// How the suites of this folder watch a device: every completion is counted and numbered, and
// checked once more after the device is gone. For the sources of this folder only.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/conformance/fixtures.h"

namespace lightstage {

// One operation's completion. Numbers tell in which order the completions of a rule were called.
class CompletionCount {
 public:
  CompletionCount(std::string what, std::shared_ptr<std::atomic<int>> order)
      : what_(std::move(what)), order_(std::move(order)) {}
  virtual ~CompletionCount() = default;
  const std::string& what() const { return what_; }
  int calls() const { return calls_.load(); }
  bool done() const { return calls() > 0; }
  int number() const { return number_.load(); }

 protected:
  void Count() {
    number_ = (*order_)++;
    ++calls_;
  }

 private:
  const std::string what_;
  const std::shared_ptr<std::atomic<int>> order_;
  std::atomic<int> calls_{0}, number_{-1};
};

template <class T>
class Outcome : public CompletionCount, public std::enable_shared_from_this<Outcome<T>> {
 public:
  Outcome(std::string what, std::shared_ptr<std::atomic<int>> order, Clock& clock)
      : CompletionCount(std::move(what), std::move(order)), clock_(&clock) {}

  // `then` runs inside the completion, for rules about what may be called from there.
  Completion<T> sink(std::function<void()> then = {}) {
    return [self = this->shared_from_this(), then = std::move(then)](absl::StatusOr<T> result) {
      if (self->calls() == 0) {
        self->result_ = std::move(result);
        self->called_at_ = self->clock_->Now();
      }
      self->Count();
      if (then) then();
      self->clock_->Notify();
    };
  }

  // The result; a test failure and an error if it has not come within `patience`.
  const absl::StatusOr<T>& Wait(Duration patience) {
    if (!clock_->WaitUntil(clock_->Now() + patience, [this] { return done(); })) {
      ADD_FAILURE() << what() << " never completed";
      static const absl::StatusOr<T> kNothing(absl::UnknownError("never completed"));
      return kNothing;
    }
    return result_;
  }
  const absl::StatusOr<T>& result() const { return result_; }  // valid once done()
  TimePoint called_at() const { return called_at_; }

 private:
  Clock* const clock_;
  absl::StatusOr<T> result_{absl::UnknownError("no result yet")};
  TimePoint called_at_{};
};

// The device of one rule. Closing it checks that every completion was called exactly once.
template <class Fixture, class Device>
class Bench {
 public:
  explicit Bench(Fixture& fixture) : fixture_(fixture) {
    absl::StatusOr<std::unique_ptr<Device>> opened = fixture.Open();
    EXPECT_TRUE(opened.ok()) << "the fixture can not open its device: " << opened.status();
    if (opened.ok()) device_ = *std::move(opened);
  }
  ~Bench() { Close(); }

  bool open() const { return device_ != nullptr; }
  Device& device() { return *device_; }
  Fixture& fixture() { return fixture_; }
  Clock& clock() { return fixture_.clock(); }
  Duration patience() const { return fixture_.patience(); }
  TimePoint Deadline() { return clock().Now() + patience(); }

  template <class T>
  std::shared_ptr<Outcome<T>> Expect(std::string what) {
    auto outcome = std::make_shared<Outcome<T>>(std::move(what), order_, clock());
    outcomes_.push_back(outcome);
    return outcome;
  }

  void Close() {
    if (!device_) return;
    device_.reset();
    for (const auto& outcome : outcomes_) {
      EXPECT_EQ(outcome->calls(), 1) << outcome->what() << " must complete exactly once";
    }
  }

 private:
  Fixture& fixture_;
  std::unique_ptr<Device> device_;
  std::shared_ptr<std::atomic<int>> order_ = std::make_shared<std::atomic<int>>(0);
  std::vector<std::shared_ptr<CompletionCount>> outcomes_;
};

// An error with this code and, unless empty, this reason.
void ExpectError(const absl::Status& status, absl::StatusCode code, std::string_view reason,
                 const std::string& what);

template <class Fixture>
struct Rule {
  const char* name;
  void (*check)(Fixture&);
};

template <class Fixture>
class RuleTest : public testing::Test {
 public:
  RuleTest(FixtureFactory<Fixture> make, void (*check)(Fixture&)) : make_(make), check_(check) {}
  void TestBody() override { check_(*make_()); }

 private:
  FixtureFactory<Fixture> make_;
  void (*check_)(Fixture&);
};

template <class Fixture, size_t N>
bool RegisterRules(const std::string& suite, const Rule<Fixture> (&rules)[N],
                   FixtureFactory<Fixture> make, const char* file, int line) {
  for (const Rule<Fixture>& rule : rules) {
    auto check = rule.check;
    testing::RegisterTest(
        suite.c_str(), rule.name, nullptr, nullptr, file, line,
        [make, check]() -> testing::Test* { return new RuleTest<Fixture>(make, check); });
  }
  return true;
}

}  // namespace lightstage
