#include <math.h>
#include <string.h>

#include "grouser/episodes.h"
#include "module.h"

/* Arrays of the caller: a row a vehicle. */
enum slot {
  ACTIONS,
  IDLE,
  OBSERVATIONS,
  REWARDS,
  TERMS,
  MEASURES,
  TERMINATED,
  TRUNCATED,
  MEMORY,
  PERIODS,
  PREVIOUS,
  PARAMETERS,
  POSES,
  SLOTS
};

typedef struct {
  PyObject_HEAD
  grouser_episodes episodes;
  grouser_task task;
  const grouser_fleet_hold *hold;
  PyObject *fleet, *rules, *slip_block; /* that the episodes point into */
  Py_buffer views[SLOTS];
  double *commands;
} episodes_object;

typedef struct {
  const char *name, *format;
  size_t size, columns;
} shape;

static int acquire(PyObject *object, const shape *expected, int vehicles, Py_buffer *view) {
  if (PyObject_GetBuffer(object, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | PyBUF_WRITABLE) < 0) {
    view->obj = NULL;
    PyErr_Format(PyExc_ValueError, "%s must be a C-contiguous, writable array", expected->name);
    return -1;
  }
  const size_t bytes = expected->size * expected->columns * (size_t)vehicles;
  if (view->format && strcmp(view->format, expected->format) == 0 && (size_t)view->len == bytes &&
      (uintptr_t)view->buf % expected->size == 0)
    return 0;
  PyErr_Format(PyExc_ValueError, "%s must hold %d rows of %zd values of format '%s'", expected->name, vehicles,
               (Py_ssize_t)expected->columns, expected->format);
  return -1;
}

static int acquire_arrays(episodes_object *self, PyObject *const *objects) {
  grouser_episodes *e = &self->episodes;
  const size_t d = sizeof(double);
  const shape shapes[SLOTS] = {[ACTIONS] = {"actions", "d", d, 2},
                               [IDLE] = {"idle", "?", 1, 1},
                               [OBSERVATIONS] = {"observations", "f", sizeof(float),
                                                 (size_t)grouser_task_observation_size(&self->task)},
                               [REWARDS] = {"rewards", "d", d, 1},
                               [TERMS] = {"terms", "d", d, GROUSER_TASK_TERMS},
                               [MEASURES] = {"measures", "d", d, GROUSER_TASK_MEASURES},
                               [TERMINATED] = {"terminated", "?", 1, 1},
                               [TRUNCATED] = {"truncated", "?", 1, 1},
                               [MEMORY] = {"memory", "d", d, e->rules->memory / d},
                               [PERIODS] = {"periods", "d", d, 1},
                               [PREVIOUS] = {"previous", "d", d, 2},
                               [PARAMETERS] = {"parameters", "d", d, GROUSER_MAX_PARAMETERS},
                               [POSES] = {"poses", "d", d, 3}};
  for (int slot = 0; slot < SLOTS; slot++)
    if (acquire(objects[slot], &shapes[slot], e->fleet->vehicles, &self->views[slot]) < 0) return -1;
  e->actions = self->views[ACTIONS].buf;
  e->idle = self->views[IDLE].buf;
  e->observations = self->views[OBSERVATIONS].buf;
  e->rewards = self->views[REWARDS].buf;
  e->terms = self->views[TERMS].buf;
  e->measures = self->views[MEASURES].buf;
  e->terminated = self->views[TERMINATED].buf;
  e->truncated = self->views[TRUNCATED].buf;
  e->memory = self->views[MEMORY].buf;
  e->periods = self->views[PERIODS].buf;
  e->previous = self->views[PREVIOUS].buf;
  e->parameters = self->views[PARAMETERS].buf;
  e->poses = self->views[POSES].buf;
  return 0;
}

/* Ranges of the observed terrain parameters, two rows of numbers or none; -1 and an error raised if they are neither. */
static int read_ranges(PyObject *object, int columns, grouser_task *task) {
  grouser_array ranges;
  const int parameters = columns - GROUSER_TERRAIN;
  if (grouser_array_acquire(object, "ranges", parameters, 0, &ranges) < 0) return -1;
  const Py_ssize_t rows = ranges.rows;
  if (rows == 2) {
    memcpy(task->low, ranges.data, sizeof(double) * (size_t)parameters);
    memcpy(task->high, ranges.data + parameters, sizeof(double) * (size_t)parameters);
    task->parameters = parameters;
  }
  grouser_array_release(&ranges);
  if (rows == 0 || rows == 2) return 0;
  PyErr_Format(PyExc_ValueError, "ranges must hold lowest and highest terrain parameters, or nothing, got %zd rows", rows);
  return -1;
}

static int task_is_possible(const grouser_task *task, int ticks) {
  const double positive[] = {(double)ticks,         (double)task->steps,   task->control_period,   task->training_speed,
                             task->tread,           task->yaw_rate_scale,  task->bound,            task->slip_power_scale};
  for (size_t n = 0; n < sizeof positive / sizeof *positive; n++)
    if (!(positive[n] > 0 && isfinite(positive[n]))) {
      PyErr_SetString(PyExc_ValueError, "ticks, steps, control_period, training_speed, tread, yaw_rate_scale, bound and "
                                        "slip_power_scale must be positive and finite");
      return 0;
    }
  return 1;
}

static int build(episodes_object *self, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"fleet", "rules", "slip_block", "ticks", "steps", "twist", "control_period",
                          "training_speed", "tread", "yaw_rate_scale", "bound", "action_change_weight",
                          "slip_power_weight", "slip_power_scale", "broken_off_reward", "ranges", "actions", "idle",
                          "observations", "rewards", "terms", "measures", "terminated", "truncated", "memory",
                          "periods", "previous", "parameters", "poses",
                          NULL};
  grouser_episodes *e = &self->episodes;
  grouser_task *t = &self->task;
  PyObject *fleet, *rules, *slip_block, *ranges, *arrays[SLOTS];
  if (!PyArg_ParseTupleAndKeywords(
          arguments, keywords, "OOOilpdddddddddOOOOOOOOOOOOOO", names, &fleet, &rules, &slip_block, &e->ticks, &t->steps,
          &t->twist, &t->control_period, &t->training_speed, &t->tread, &t->yaw_rate_scale, &t->bound,
          &t->action_change_weight, &t->slip_power_weight, &t->slip_power_scale, &t->broken_off_reward, &ranges,
          &arrays[ACTIONS], &arrays[IDLE], &arrays[OBSERVATIONS], &arrays[REWARDS], &arrays[TERMS], &arrays[MEASURES],
          &arrays[TERMINATED], &arrays[TRUNCATED], &arrays[MEMORY], &arrays[PERIODS],
          &arrays[PREVIOUS], &arrays[PARAMETERS], &arrays[POSES]))
    return -1;
  if (!task_is_possible(t, e->ticks)) return -1;
  self->fleet = Py_NewRef(fleet);
  self->rules = Py_NewRef(rules);
  self->slip_block = Py_NewRef(slip_block);
  self->hold = grouser_pointer_of(fleet, "fleet", GROUSER_FLEET_CAPSULE);
  e->rules = self->hold ? grouser_pointer_of(rules, "rules", GROUSER_RULES_CAPSULE) : NULL;
  e->slip_block = e->rules ? grouser_pointer_of(slip_block, "kernel", GROUSER_KERNEL_CAPSULE) : NULL;
  if (!e->slip_block) return -1;
  e->fleet = self->hold->fleet;
  e->task = t;
  const int columns = e->fleet->plant->kernel->columns;
  if (!e->slip_block->evaluate_track || e->slip_block->columns != columns) {
    PyErr_SetString(PyExc_ValueError, "slip_block must know the tracks apart, and have the columns of the fleet's kernel");
    return -1;
  }
  if (read_ranges(ranges, columns, t) < 0 || acquire_arrays(self, arrays) < 0) return -1;
  self->commands = e->commands = PyMem_Calloc((size_t)e->fleet->vehicles, 2 * sizeof *e->commands);
  if (e->commands) return 0;
  PyErr_NoMemory();
  return -1;
}

static PyObject *episodes_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  PyObject *self = allocate(type, 0);
  if (self && build((episodes_object *)self, arguments, keywords) < 0) Py_CLEAR(self);
  return self;
}

static void episodes_dealloc(PyObject *object) {
  episodes_object *self = (episodes_object *)object;
  PyTypeObject *type = Py_TYPE(object);
  for (int slot = 0; slot < SLOTS; slot++)
    if (self->views[slot].obj) PyBuffer_Release(&self->views[slot]);
  PyMem_Free(self->commands);
  Py_XDECREF(self->fleet);
  Py_XDECREF(self->rules);
  Py_XDECREF(self->slip_block);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(object);
  Py_DECREF(type);
}

static int may_advance(const episodes_object *self) {
  if (*self->hold->advancing)
    PyErr_SetString(PyExc_RuntimeError, "the fleet is being advanced by another thread");
  else if (*self->hold->without_ground)
    PyErr_Format(PyExc_ValueError, "%d vehicles have no ground yet: see set_ground", *self->hold->without_ground);
  else
    return 1;
  return 0;
}

static PyObject *episodes_step(PyObject *object, PyObject *unused) {
  (void)unused;
  episodes_object *self = (episodes_object *)object;
  const grouser_episodes *e = &self->episodes;
  if (!may_advance(self)) return NULL;
  for (int vehicle = 0; vehicle < e->fleet->vehicles; vehicle++) {
    const double *action = e->actions + 2 * (size_t)vehicle;
    /* An inequality that NaN fails. */
    if (!e->idle[vehicle] && !(fabs(action[0]) <= 1.0 && fabs(action[1]) <= 1.0))
      return PyErr_Format(PyExc_ValueError, "the action of vehicle %d must be two numbers in [-1, 1]", vehicle);
  }
  *self->hold->advancing = 1;
  Py_BEGIN_ALLOW_THREADS
  grouser_episodes_step(e, self->hold->pool);
  Py_END_ALLOW_THREADS
  *self->hold->advancing = 0;
  return Py_NewRef(Py_None);
}

static PyObject *episodes_begin(PyObject *object, PyObject *argument) {
  episodes_object *self = (episodes_object *)object;
  const int vehicles = self->episodes.fleet->vehicles;
  const long vehicle = PyLong_AsLong(argument);
  if (vehicle == -1 && PyErr_Occurred()) return NULL;
  if (vehicle < 0 || vehicle >= vehicles)
    return PyErr_Format(PyExc_ValueError, "vehicle must lie in [0, %d), got %ld", vehicles, vehicle);
  if (!may_advance(self)) return NULL;
  grouser_episodes_begin(&self->episodes, (int)vehicle);
  return Py_NewRef(Py_None);
}

static PyMethodDef episodes_methods[] = {
    {"step", episodes_step, METH_NOARGS, "step(): hold every vehicle's action for one control period."},
    {"begin", episodes_begin, METH_O,
     "begin(vehicle): begin an episode, given its state, ground and memory; writes its observation and measures."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot episodes_slots[] = {{Py_tp_new, episodes_new},
                                       {Py_tp_dealloc, episodes_dealloc},
                                       {Py_tp_methods, episodes_methods},
                                       {Py_tp_doc, "Episodes of one task on a fleet, in the caller's arrays."},
                                       {0, NULL}};

static PyType_Spec episodes_spec = {"grouser.native._core.Episodes", sizeof(episodes_object), 0, Py_TPFLAGS_DEFAULT,
                                    episodes_slots};

int grouser_add_episodes_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&episodes_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Episodes", type);
  Py_DECREF(type);
  return status;
}
