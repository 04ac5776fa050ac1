/* Simulink C S-function (level 2) of $name.
 *
 *   mex ${name}_sfun.c $name.c
 *
 * Parameter: sample time in s. Input: one row, $columns.
 * Outputs: [Qx, Qy, Mz] in N, N, N m; score of the detector, above 1 where the row is unlike the training data.
 * The guard's memory is in DWork: the surrogate answers where it was trained, the physics elsewhere. */
#define S_FUNCTION_NAME ${name}_sfun
#define S_FUNCTION_LEVEL 2

#include "simstruc.h"

#include "$name.h"

enum { GUARD_NOW, GUARD_NEXT, GUARDS };
enum { MODE, SAMPLES, FLAGS, DWELL, CALM, WEIGHT, GUARD_WIDTH };

static void keep_guard(SimStruct *S, int which, grouser_guard_state guard) {
  real_T *kept = (real_T *)ssGetDWork(S, which);
  kept[MODE] = guard.mode;
  kept[SAMPLES] = guard.samples;
  kept[FLAGS] = guard.flags;
  kept[DWELL] = guard.dwell;
  kept[CALM] = guard.calm;
  kept[WEIGHT] = guard.fallback_weight;
}

static grouser_guard_state kept_guard(SimStruct *S, int which) {
  const real_T *kept = (const real_T *)ssGetDWork(S, which);
  grouser_guard_state guard = grouser_fresh_guard();
  guard.mode = kept[MODE] > 0 ? GROUSER_FALLBACK : GROUSER_PRIMARY;
  guard.samples = (int)kept[SAMPLES];
  guard.flags = (uint32_t)kept[FLAGS];
  guard.dwell = kept[DWELL];
  guard.calm = kept[CALM];
  guard.fallback_weight = kept[WEIGHT];
  return guard;
}

static void mdlInitializeSizes(SimStruct *S) {
  ssSetNumSFcnParams(S, 1);
  if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) return;
  if (!ssSetNumInputPorts(S, 1) || !ssSetNumOutputPorts(S, 2)) return;
  ssSetInputPortWidth(S, 0, GROUSER_COLUMNS);
  ssSetInputPortRequiredContiguous(S, 0, 1);
  ssSetInputPortDirectFeedThrough(S, 0, 1);
  ssSetOutputPortWidth(S, 0, GROUSER_OUTPUTS);
  ssSetOutputPortWidth(S, 1, 1);
  ssSetNumSampleTimes(S, 1);
  ssSetNumDWork(S, GUARDS);
  ssSetDWorkWidth(S, GUARD_NOW, GUARD_WIDTH);
  ssSetDWorkWidth(S, GUARD_NEXT, GUARD_WIDTH);
}

static void mdlInitializeSampleTimes(SimStruct *S) {
  ssSetSampleTime(S, 0, mxGetScalar(ssGetSFcnParam(S, 0)));
  ssSetOffsetTime(S, 0, 0.0);
}

#define MDL_START
static void mdlStart(SimStruct *S) {
  if (!grouser_abi_matches(GROUSER_ABI_VERSION)) ssSetErrorStatus(S, "$name: header and source are of two exports");
  if (!(ssGetSampleTime(S, 0) > 0)) ssSetErrorStatus(S, "$name: the sample time must be above 0 s");
}

#define MDL_INITIALIZE_CONDITIONS
static void mdlInitializeConditions(SimStruct *S) {
  keep_guard(S, GUARD_NOW, grouser_fresh_guard());
  keep_guard(S, GUARD_NEXT, grouser_fresh_guard());
}

/* May be called more than once a sample: the guard moves on in mdlUpdate. */
static void mdlOutputs(SimStruct *S, int_T tid) {
  const real_T *row = (const real_T *)ssGetInputPortSignal(S, 0);
  const real_T elapsed = ssGetSampleTime(S, 0);
  grouser_guard_state guard = kept_guard(S, GUARD_NOW);
  grouser_detection detection;
  (void)tid;
  if (grouser_guarded_forces(&guard, elapsed, row, ssGetOutputPortRealSignal(S, 0), NULL, &detection)) {
    ssSetErrorStatus(S, "$name: an input is not finite, or out of the block's domain");
    return;
  }
  *ssGetOutputPortRealSignal(S, 1) = detection.score;
  keep_guard(S, GUARD_NEXT, guard);
}

#define MDL_UPDATE
static void mdlUpdate(SimStruct *S, int_T tid) {
  (void)tid;
  keep_guard(S, GUARD_NOW, kept_guard(S, GUARD_NEXT));
}

static void mdlTerminate(SimStruct *S) { (void)S; }

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
