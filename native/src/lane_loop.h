/* Before a loop over the lanes of a block: compilers are apt to unroll one so short before they look at vectorising it. */
#ifndef GROUSER_LANE_LOOP_H
#define GROUSER_LANE_LOOP_H

#if defined(__clang__)
#define GROUSER_LANE_LOOP _Pragma("clang loop unroll(disable)")
#elif defined(__GNUC__)
#define GROUSER_LANE_LOOP _Pragma("GCC unroll 1")
#else
#define GROUSER_LANE_LOOP
#endif

#endif
