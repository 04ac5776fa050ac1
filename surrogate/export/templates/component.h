// Unreal Engine: an actor that drives on $vehicle tracks over $mode ground. A snippet to start from.
#pragma once

#include "Components/ActorComponent.h"
#include "CoreMinimal.h"

#include "$name.h"

#include "$component.generated.h"

UCLASS(ClassGroup = (Grouser), meta = (BlueprintSpawnableComponent))
class U$component : public UActorComponent {
  GENERATED_BODY()

 public:
  U$component();

  // Commanded belt speeds in m/s, positive drives forward.
  UPROPERTY(EditAnywhere, BlueprintReadWrite) double LeftBelt = 0.0;
  UPROPERTY(EditAnywhere, BlueprintReadWrite) double RightBelt = 0.0;
  // Ground under the vehicle: $parameter_columns, in SI units.
  UPROPERTY(EditAnywhere, BlueprintReadWrite) TArray<double> Terrain;
  // Share of the physics in the force: 0 where the surrogate is trusted.
  UPROPERTY(VisibleAnywhere, BlueprintReadOnly) double FallbackWeight = 0.0;

  virtual void BeginPlay() override;
  virtual void TickComponent(float Seconds, ELevelTick Type, FActorComponentTickFunction* Function) override;

 private:
  grouser_vehicle_state State;
  FTransform Start;
  double Owed = 0.0;
};
