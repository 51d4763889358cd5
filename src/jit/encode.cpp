// The only file that knows the assembler. SPDX-License-Identifier: Apache-2.0
#include "encode.h"

#include <xbyak/xbyak.h>

#include <deque>
#include <stdexcept>

#include "lockstep/error.h"

namespace lockstep::jit {
namespace {

using Generator = Xbyak::CodeGenerator;
using Xbyak::Label, Xbyak::Operand, Xbyak::Reg64, Xbyak::Xmm;
using Three = void (Generator::*)(const Xmm&, const Xmm&, const Operand&);
using ThreeAlike = void (Generator::*)(const Xmm&, const Operand&, const Operand&);

// Which registers have what (System V): the arguments are the first and the last frame. A function may change all of
// these.
const Reg64 &block = Xbyak::util::rdi, &slots = Xbyak::util::rsi, &tile = Xbyak::util::rdx,
            &constants_base = Xbyak::util::rcx, &first_frame = Xbyak::util::r8, &frame = Xbyak::util::r9,
            &last_frame = Xbyak::util::r10;
const Xbyak::Reg32& turns = Xbyak::util::r11d;
const Xbyak::Opmask& k1 = Xbyak::util::k1;

constexpr std::size_t most_bytes = 64;  // of an Instruction: a call is the longest

class Encoder {
 public:
  Encoder(const Machine& machine, CallStage call, std::size_t room)
      : machine_(machine), call_(call), bytes_(room), a_(bytes_.size(), bytes_.data()) {}

  std::vector<std::uint8_t> run(const Allocated& code, const std::vector<std::uint64_t>& constants) {
    cold_.resize(code.cold.size());
    a_.push(Xbyak::util::rbp);  // with this, debuggers and profilers find who called
    a_.mov(Xbyak::util::rbp, Xbyak::util::rsp);
    a_.mov(first_frame, Xbyak::util::rdi);
    a_.mov(last_frame, Xbyak::util::rsi);
    a_.mov(frame, first_frame);
    load_constants_base();
    handed_ = code.first_handed * machine_.register_bytes;
    subroutines_.resize(code.subroutines.size());
    put_all(code.instructions);
    a_.vzeroupper();
    a_.pop(Xbyak::util::rbp);
    a_.ret();
    for (std::size_t i = 0; i < code.cold.size(); ++i) {
      a_.L(cold_[i].begin);
      put_all(code.cold[i]);
    }
    for (std::size_t i = 0; i < code.subroutines.size(); ++i) {
      align();
      a_.L(subroutines_[i]);
      a_.sub(Xbyak::util::rsp, 8);  // as aligned as the step itself
      put_all(code.subroutines[i]);
      a_.add(Xbyak::util::rsp, 8);
      a_.ret();
    }
    align();
    a_.L(constants_);
    const int times = machine_.constant_bytes() / machine_.scalar_bytes;
    for (const std::uint64_t bits : constants)
      for (int k = 0; k < times; ++k) a_.db(bits, static_cast<std::size_t>(machine_.scalar_bytes));
    if (a_.hasUndefinedLabel()) throw std::logic_error("machine code jumps nowhere");
    bytes_.resize(a_.getSize());
    return std::move(bytes_);
  }

 private:
  // Where a part of the code begins, and what comes behind it.
  struct Ends {
    Label begin, behind;
  };

  bool single() const { return machine_.scalar_bytes == 4; }
  bool avx512() const { return machine_.avx512(); }
  Xmm r(int number) const {
    if (avx512()) return Xbyak::Zmm(number);
    return Xbyak::Ymm(number);
  }

  static const Reg64& base(Memory::Base base) {
    switch (base) {
      case Memory::block: return block;
      case Memory::slots:
      case Memory::handed: return slots;
      case Memory::tile: return tile;
      default: return constants_base;
    }
  }
  int offset(const Memory& at) const { return at.base == Memory::handed ? handed_ + at.offset : at.offset; }
  Xbyak::Address whole(const Memory& at) const { return a_.ptr[base(at.base) + offset(at)]; }
  // As an operand of arithmetic: a constant is read into all lanes.
  Xbyak::Address operand(const Memory& at) const {
    return at.base == Memory::constants && avx512() ? a_.ptr_b[base(at.base) + at.offset] : whole(at);
  }

  void align() {
    while (a_.getSize() % 64 != 0) a_.db(0);
  }
  void put_all(const std::vector<Instruction>& code) {
    for (const Instruction& instruction : code) put(instruction);
  }

  void put(const Instruction& i) {
    switch (i.kind) {
      case Instruction::load: return load(i);
      case Instruction::store: return a_.vmovups(whole(i.at), r(i.a));
      case Instruction::move: return a_.vmovaps(r(i.to), r(i.a));
      case Instruction::compute: return compute(i);
      case Instruction::fused: return with_last(fused(i), r(i.to), r(i.a), i);
      case Instruction::ternary: return ternary(i);
      case Instruction::begin_part:
        parts_.emplace_back();
        a_.L(parts_.back());
        return load_bases();
      case Instruction::end_part:
        a_.add(frame, sizeof(Frame));
        a_.cmp(frame, last_frame);
        a_.jb(parts_.back(), Generator::T_NEAR);
        return a_.mov(frame, first_frame);
      case Instruction::begin_loop:
        loops_.emplace_back();
        a_.mov(turns, i.number);
        return a_.L(loops_.back());
      case Instruction::end_loop: a_.dec(turns); return a_.jnz(loops_.back(), Generator::T_NEAR);
      case Instruction::begin_unless:
      case Instruction::begin_scope: return begin_scope(i);
      case Instruction::end_scope: return end_scope(i);
      case Instruction::if_any:
        test(i.a);
        a_.jnz(cold_[static_cast<std::size_t>(i.number)].begin, Generator::T_NEAR);
        return a_.L(cold_[static_cast<std::size_t>(i.number)].behind);
      case Instruction::call: return call(i);
      case Instruction::run: return a_.call(subroutines_[static_cast<std::size_t>(i.number)]);
      case Instruction::resume: return a_.jmp(cold_[static_cast<std::size_t>(i.number)].behind, Generator::T_NEAR);
    }
  }

  void load_bases() {
    a_.mov(block, a_.ptr[frame + offsetof(Frame, block)]);
    a_.mov(slots, a_.ptr[frame + offsetof(Frame, slots)]);
    a_.mov(tile, a_.ptr[frame + offsetof(Frame, tile)]);
  }
  void load_constants_base() { a_.lea(constants_base, a_.ptr[a_.rip + constants_]); }

  void load(const Instruction& i) {
    if (i.at.base != Memory::constants || !avx512()) return a_.vmovups(r(i.to), whole(i.at));
    const Xbyak::Zmm to(i.to);
    single() ? a_.vbroadcastss(to, whole(i.at)) : a_.vbroadcastsd(to, whole(i.at));
  }

  // The last operand is the register b, or memory.
  template <class To, class Inst>
  void with_last(Inst inst, const To& to, const Xmm& a, const Instruction& i) {
    if (i.in_memory)
      (a_.*inst)(to, a, operand(i.at));
    else
      (a_.*inst)(to, a, r(i.b));
  }
  template <class Inst>
  void two(Inst in_single, Inst in_double, const Instruction& i) {
    with_last(single() ? in_single : in_double, r(i.to), r(i.a), i);
  }

  void compute(const Instruction& i) {
    using G = Generator;
    const auto arithmetic = [&](ThreeAlike in_single, ThreeAlike in_double) { two(in_single, in_double, i); };
    const auto bits = [&](Three in_single, Three in_double) { two(in_single, in_double, i); };
    switch (i.op) {
      case Op::sqrt: {
        const auto root = single() ? static_cast<void (G::*)(const Xmm&, const Operand&)>(&G::vsqrtps)
                                   : static_cast<void (G::*)(const Xmm&, const Operand&)>(&G::vsqrtpd);
        return i.in_memory ? (a_.*root)(r(i.to), operand(i.at)) : (a_.*root)(r(i.to), r(i.a));
      }
      case Op::shift_left: {
        const auto by = static_cast<std::uint8_t>(i.number);
        return single() ? a_.vpslld(r(i.to), r(i.a), by) : a_.vpsllq(r(i.to), r(i.a), by);
      }
      case Op::spread_sign: return single() ? a_.vpsrad(r(i.to), r(i.a), 31) : a_.vpsraq(r(i.to), r(i.a), 63);
      case Op::add: return arithmetic(&G::vaddps, &G::vaddpd);
      case Op::subtract: return arithmetic(&G::vsubps, &G::vsubpd);
      case Op::multiply: return arithmetic(&G::vmulps, &G::vmulpd);
      case Op::divide: return arithmetic(&G::vdivps, &G::vdivpd);
      case Op::both: return avx512() ? bits(&G::vpandd, &G::vpandq) : arithmetic(&G::vandps, &G::vandpd);
      case Op::either: return avx512() ? bits(&G::vpord, &G::vporq) : arithmetic(&G::vorps, &G::vorpd);
      case Op::differ: return avx512() ? bits(&G::vpxord, &G::vpxorq) : arithmetic(&G::vxorps, &G::vxorpd);
      case Op::larger: return bits(&G::vpmaxsd, &G::vpmaxsq);
      case Op::less: return less(i);
      case Op::greater: {
        using ToMask = void (G::*)(const Xbyak::Opmask&, const Xmm&, const Operand&);
        if (!avx512()) return bits(&G::vpcmpgtd, &G::vpcmpgtq);
        with_last(single() ? static_cast<ToMask>(&G::vpcmpgtd) : static_cast<ToMask>(&G::vpcmpgtq), k1, r(i.a), i);
        return as_bits(i);
      }
      case Op::select: {
        using Blend = void (G::*)(const Xmm&, const Xmm&, const Operand&, const Xmm&);
        const Blend blend = single() ? static_cast<Blend>(&G::vblendvps) : static_cast<Blend>(&G::vblendvpd);
        return i.in_memory ? (a_.*blend)(r(i.to), r(i.a), operand(i.at), r(i.c))
                           : (a_.*blend)(r(i.to), r(i.a), r(i.b), r(i.c));
      }
      default: throw std::logic_error("an operation has no instruction");
    }
  }

  // With AVX-512 a comparison makes a mask register. It becomes a mask of bits.
  void as_bits(const Instruction& i) { single() ? a_.vpmovm2d(r(i.to), k1) : a_.vpmovm2q(r(i.to), k1); }

  void less(const Instruction& i) {
    constexpr std::uint8_t ordered_less = 0x11;
    const auto compare = [&](const auto& to, const auto& b) {
      single() ? a_.vcmpps(to, r(i.a), b, ordered_less) : a_.vcmppd(to, r(i.a), b, ordered_less);
    };
    const auto compare_to = [&](const auto& to) { i.in_memory ? compare(to, operand(i.at)) : compare(to, r(i.b)); };
    if (!avx512()) return compare_to(r(i.to));
    compare_to(k1);
    as_bits(i);
  }

  Three fused(const Instruction& i) const {
    using G = Generator;
    static constexpr Three all[3][3][2] = {
        {{&G::vfmadd132ps, &G::vfmadd132pd}, {&G::vfmadd213ps, &G::vfmadd213pd}, {&G::vfmadd231ps, &G::vfmadd231pd}},
        {{&G::vfmsub132ps, &G::vfmsub132pd}, {&G::vfmsub213ps, &G::vfmsub213pd}, {&G::vfmsub231ps, &G::vfmsub231pd}},
        {{&G::vfnmadd132ps, &G::vfnmadd132pd},
         {&G::vfnmadd213ps, &G::vfnmadd213pd},
         {&G::vfnmadd231ps, &G::vfnmadd231pd}}};
    const int form = i.number == 132 ? 0 : i.number == 213 ? 1 : 2;
    const int kind = i.op == Op::fma ? 0 : i.op == Op::fms ? 1 : 2;
    return all[kind][form][single() ? 0 : 1];
  }

  void ternary(const Instruction& i) {
    const auto table = static_cast<std::uint8_t>(i.number);
    const auto with = [&](const Operand& b) {
      single() ? a_.vpternlogd(r(i.to), r(i.a), b, table) : a_.vpternlogq(r(i.to), r(i.a), b, table);
    };
    i.in_memory ? with(operand(i.at)) : with(r(i.b));
  }

  // Not zero if a lane of the mask is true.
  void test(int mask) {
    if (!avx512()) return a_.vptest(r(mask), r(mask));
    a_.vptestmd(k1, r(mask), r(mask));
    a_.kortestw(k1, k1);
  }

  void begin_scope(const Instruction& i) {
    scopes_.emplace_back();
    test(i.a);
    i.kind == Instruction::begin_scope ? a_.jz(scopes_.back().behind, Generator::T_NEAR)
                                       : a_.jnz(scopes_.back().behind, Generator::T_NEAR);
    if (i.number > 1) a_.mov(counter(i.at), i.number);
    a_.L(scopes_.back().begin);
  }
  void end_scope(const Instruction& i) {
    if (i.a >= 0) {
      test(i.a);
      a_.jz(scopes_.back().behind, Generator::T_NEAR);
      a_.dec(counter(i.at));
      a_.jnz(scopes_.back().begin, Generator::T_NEAR);
    }
    a_.L(scopes_.back().behind);
    scopes_.pop_back();
  }
  Xbyak::Address counter(const Memory& at) const { return a_.dword[base(at.base) + at.offset]; }

  // All registers are lost in a call. The bases are read again; the allocation has saved the values.
  void call(const Instruction& i) {
    a_.push(frame);
    a_.push(first_frame);
    a_.push(last_frame);
    a_.push(constants_base);  // four words, rbp and the return address: the stack is aligned to 16 bytes
    a_.vzeroupper();
    a_.mov(Xbyak::util::rdi, frame);
    a_.mov(Xbyak::util::esi, i.number);
    a_.mov(Xbyak::util::rax, reinterpret_cast<std::uint64_t>(call_));
    a_.call(Xbyak::util::rax);
    a_.pop(constants_base);
    a_.pop(last_frame);
    a_.pop(first_frame);
    a_.pop(frame);
    load_bases();
  }

  const Machine& machine_;
  CallStage call_;
  std::vector<std::uint8_t> bytes_;
  mutable Generator a_;
  Label constants_;
  int handed_ = 0;                                 // bytes from slot 0
  std::deque<Label> parts_, loops_, subroutines_;  // labels do not move
  std::deque<Ends> cold_, scopes_;
};

}  // namespace

std::vector<std::uint8_t> encode(const Allocated& code, const std::vector<std::uint64_t>& constants,
                                 const Machine& machine, CallStage call) {
  std::size_t instructions = code.instructions.size() + 8;
  for (const auto* parts : {&code.cold, &code.subroutines})
    for (const std::vector<Instruction>& part : *parts) instructions += part.size() + 2;
  const std::size_t room =
      instructions * most_bytes + constants.size() * static_cast<std::size_t>(machine.constant_bytes()) + 64;
  try {
    return Encoder(machine, call, room).run(code, constants);
  } catch (const Xbyak::Error& error) {
    throw Error("machine code", std::string("has an instruction that cannot be encoded: ") + error.what(),
                "use Engine::tables, and report this as a bug");
  }
}

}  // namespace lockstep::jit
