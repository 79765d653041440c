#include "drivers/modbus/lamps.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_format.h"
#include "drivers/link/light_link.h"
#include "drivers/modbus/client.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

// MODBUS Application Protocol V1.1b3, 6.1, 6.11, 6.3, 6.12: the smaller of what one read and one write can hold.
constexpr size_t kMostCoils = 1968, kMostRegisters = 123;

class ModbusLampsLink final : public LampsLink {
 public:
  ModbusLampsLink(const ModbusLampsOptions& options, const DeviceContext& context)
      : o_(options), name_(context.name), clock_(*context.clock) {
    int first = 0;
    for (const LampBoard& board : o_.boards) {
      boards_.push_back({ModbusClient(o_.line, board.unit, context.name, *context.clock), first,
                         LampRuns(board.addresses, o_.registers ? kMostRegisters : kMostCoils)});
      first += static_cast<int>(board.addresses.size());
    }
  }

  absl::Status Connect() override {
    known_ = false;
    for (Board& board : boards_) RETURN_IF_ERROR(board.client.Connect());
    RETURN_IF_ERROR(WriteWatchdog());
    return Set(std::vector<float>(o_.lamps(), 0.0f)).status();
  }

  LampsInfo info() const override {
    LampsInfo info;
    info.identity.model = o_.registers ? "Modbus registers" : "Modbus coils";
    info.count = o_.lamps();
    info.steps = o_.full;
    info.settle = o_.settle;
    if (o_.watchdog) info.max_time_to_dark = o_.watchdog->step * o_.watchdog->max;
    return info;
  }

  absl::StatusOr<std::vector<float>> Set(const std::vector<float>& levels) override {
    std::vector<int> wanted(o_.lamps());
    for (size_t i = 0; i < wanted.size(); ++i) {
      wanted[i] = static_cast<int>(std::lround(static_cast<double>(levels[i]) * o_.full));
    }
    const bool known = std::exchange(known_, false);
    // A board that fails does not keep the others lit.
    absl::Status first_error;
    for (Board& board : boards_) {
      for (const LampRun& run : board.runs) {
        first_error.Update(WriteRun(board, run, wanted, known));
        if (!first_error.ok()) break;
      }
    }
    RETURN_IF_ERROR(first_error);
    for (Board& board : boards_) {
      for (const LampRun& run : board.runs) RETURN_IF_ERROR(ConfirmRun(board, run, wanted));
    }
    RETURN_IF_ERROR(Refresh());
    known_ = true;
    levels_ = wanted;
    std::vector<float> taken(wanted.size());
    for (size_t i = 0; i < wanted.size(); ++i) {
      taken[i] = static_cast<float>(wanted[i]) / static_cast<float>(o_.full);
    }
    return taken;
  }

  absl::Status Check() override {
    for (Board& board : boards_) {
      for (const LampRun& run : board.runs) RETURN_IF_ERROR(ConfirmRun(board, run, levels_));
    }
    return absl::OkStatus();
  }

  absl::Status SetTimeToDark(Duration time) override {
    if (!o_.watchdog) return absl::OkStatus();
    // Not later than asked for.
    watchdog_ =
        time == Duration::zero() ? 0 : std::max<int>(1, static_cast<int>(time / o_.watchdog->step));
    return WriteWatchdog();
  }

  absl::Status Refresh() override {
    if (!o_.watchdog || watchdog_ == 0) return absl::OkStatus();
    for (Board& board : boards_) {
      RETURN_IF_ERROR(
          board.client.WriteRegister(o_.watchdog->address, static_cast<uint16_t>(watchdog_)));
    }
    return absl::OkStatus();
  }

 private:
  struct Board {
    ModbusClient client;
    int first;  // index of its first lamp
    std::vector<LampRun> runs;
  };

  int Lamp(const Board& board, const LampRun& run, size_t i) const {
    return board.first + run.lamps[i];
  }
  bool Coil(int level) const { return (level > 0) != o_.inverted; }

  absl::Status WriteRun(Board& board, const LampRun& run, const std::vector<int>& wanted,
                        bool known) {
    if (o_.single_writes) {
      // One by one takes long: only what differs, and all if it is not known what there is.
      std::vector<int> now;
      if (known) {
        ASSIGN_OR_RETURN(now, ReadRun(board, run));
      }
      for (size_t i = 0; i < run.lamps.size(); ++i) {
        const int lamp = Lamp(board, run, i), address = run.first + static_cast<int>(i);
        if (known && now[i] == wanted[lamp]) continue;
        RETURN_IF_ERROR(
            o_.registers ? board.client.WriteRegister(address, static_cast<uint16_t>(wanted[lamp]))
                         : board.client.WriteCoil(address, Coil(wanted[lamp])));
      }
      return absl::OkStatus();
    }
    if (o_.registers) {
      std::vector<uint16_t> values;
      for (size_t i = 0; i < run.lamps.size(); ++i) {
        values.push_back(static_cast<uint16_t>(wanted[Lamp(board, run, i)]));
      }
      return board.client.WriteRegisters(run.first, values);
    }
    std::vector<bool> values;
    for (size_t i = 0; i < run.lamps.size(); ++i) {
      values.push_back(Coil(wanted[Lamp(board, run, i)]));
    }
    return board.client.WriteCoils(run.first, values);
  }

  // What the board says, as register values of full light or, of coils, 0 and 1.
  absl::StatusOr<std::vector<int>> ReadRun(Board& board, const LampRun& run) {
    const int count = static_cast<int>(run.lamps.size());
    std::vector<int> levels;
    if (o_.registers) {
      ASSIGN_OR_RETURN(const std::vector<uint16_t> values,
                       board.client.ReadRegisters(run.first, count));
      levels.assign(values.begin(), values.end());
      return levels;
    }
    ASSIGN_OR_RETURN(const std::vector<bool> values, board.client.ReadCoils(run.first, count));
    for (const bool coil : values) levels.push_back(coil != o_.inverted ? 1 : 0);
    return levels;
  }

  absl::Status ConfirmRun(Board& board, const LampRun& run, const std::vector<int>& wanted) {
    const TimePoint give_up = clock_.Now() + o_.confirm;
    while (true) {
      ASSIGN_OR_RETURN(const std::vector<int> levels, ReadRun(board, run));
      size_t i = 0;
      while (i < levels.size() && levels[i] == wanted[Lamp(board, run, i)]) ++i;
      if (i == levels.size()) return absl::OkStatus();
      if (clock_.Now() >= give_up) {
        const int lamp = Lamp(board, run, i);
        return Error(absl::StatusCode::kFailedPrecondition, "LAMP_NOT_CONFIRMED",
                     absl::StrFormat("%s: lamp %d (%s %d of unit %d) was set to %d of %d and reads "
                                     "back %d",
                                     name_, lamp, o_.registers ? "register" : "coil",
                                     run.first + static_cast<int>(i), board.client.unit(),
                                     wanted[lamp], o_.full, levels[i]),
                     {{"device", name_}, {"lamp", absl::StrCat(lamp)}});
      }
      SleepFor(clock_, milliseconds(5));
    }
  }

  // Sets the dark-man timer and reads it back: it is what one relies on when all else has failed.
  absl::Status WriteWatchdog() {
    if (!o_.watchdog) return absl::OkStatus();
    for (Board& board : boards_) {
      RETURN_IF_ERROR(
          board.client.WriteRegister(o_.watchdog->address, static_cast<uint16_t>(watchdog_)));
      ASSIGN_OR_RETURN(const std::vector<uint16_t> read,
                       board.client.ReadRegisters(o_.watchdog->address, 1));
      // It may have begun to count down.
      const bool right = watchdog_ == 0 ? read[0] == 0 : read[0] > 0 && read[0] <= watchdog_;
      if (!right) {
        return Error(
            absl::StatusCode::kFailedPrecondition, "TIME_TO_DARK_NOT_CONFIRMED",
            absl::StrFormat("%s: the time to dark (register 0x%04X of unit %d) was set to %d "
                            "and reads back %d",
                            name_, o_.watchdog->address, board.client.unit(), watchdog_, read[0]),
            {{"device", name_}});
      }
    }
    return absl::OkStatus();
  }

  const ModbusLampsOptions o_;
  const std::string name_;
  Clock& clock_;
  std::vector<Board> boards_;
  std::vector<int> levels_;  // as confirmed last
  bool known_ = false;       // the last Set was confirmed
  int watchdog_ = 0;         // register value; 0: never dark by itself
};

}  // namespace

std::vector<LampRun> LampRuns(const std::vector<int>& addresses, size_t most) {
  std::vector<int> order(addresses.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return addresses[a] < addresses[b]; });
  std::vector<LampRun> runs;
  for (int lamp : order) {
    if (runs.empty() || runs.back().lamps.size() >= most ||
        runs.back().first + static_cast<int>(runs.back().lamps.size()) != addresses[lamp]) {
      runs.push_back({addresses[lamp], {}});
    }
    runs.back().lamps.push_back(lamp);
  }
  return runs;
}

absl::StatusOr<std::unique_ptr<Lamps>> OpenModbusLamps(const ModbusLampsOptions& options,
                                                       const DeviceContext& context) {
  return OpenLinkedLamps(context, "modbus", std::make_unique<ModbusLampsLink>(options, context));
}

}  // namespace lightstage
